// Sums over the open edges of a mesh. Compiled once per instruction set; the best one available is
// chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/open_edge_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "geometry/open_edge_hierarchy.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace open_edges {
namespace hn = hwy::HWY_NAMESPACE;

static_assert(OpenEdgeNode::kChildren == OpenEdgeBlock::kEdges, "as many lanes");
using FloatTag = hn::CappedTag<float, OpenEdgeBlock::kEdges>;
using Floats = hn::Vec<FloatTag>;
// A cluster is seen from afar where its sphere is farther than so many of its radii.
constexpr float kFar = 8.0F;
// Float loses no more than this share of an edge's field, where the edge is seen as a point, in its
// terms and in sums of kTerms of them; and more with the square of length / distance.
constexpr float kFieldError = 1e-5F;
constexpr int kTerms = 64;
// Distances are wrong by no more than this share.
constexpr float kDistanceError = 2e-6F;
// Float loses less than this share in a sum of positive terms.
constexpr double kSummed = 1.0 + 1e-3;
// Nodes that wait for their turn: seven a level, of a hierarchy of 2^32 edges.
constexpr std::size_t kStack = 80;

HWY_INLINE Floats Dot(Floats ax, Floats ay, Floats az, Floats bx, Floats by, Floats bz) {
  return hn::MulAdd(ax, bx, hn::MulAdd(ay, by, hn::Mul(az, bz)));
}

// Sums of edges, in lanes.
struct LaneSums {
  Floats x, y, z, error, curvature, nearest;

  HWY_INLINE void Clear() {
    const FloatTag d;
    x = y = z = error = curvature = hn::Zero(d);
    nearest = hn::Set(d, std::numeric_limits<float>::infinity());
  }

  HWY_INLINE void AddTo(OpenEdgeSums* sums) const {
    const FloatTag d;
    const auto total = [&](Floats v) {
      return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, v)));
    };
    sums->field[0] += total(x);
    sums->field[1] += total(y);
    sums->field[2] += total(z);
    sums->field_error += kSummed * static_cast<double>(kFieldError) * total(error);
    sums->curvature += kSummed * 2.0 * total(curvature);
    sums->nearest = std::min(
        sums->nearest,
        static_cast<double>((1.0F - kDistanceError) * hn::GetLane(hn::MinOfLanes(d, nearest))));
  }
};

// Adds edges by the formula of straight segments: (a x b) (1 / |a| + 1 / |b|) / (|a| |b| + a.b).
HWY_INLINE void AddEdges(const OpenEdgeBlock& block, std::size_t k, const float* p,
                         LaneSums* sums) {
  const FloatTag d;
  const auto ax = hn::Sub(hn::Load(d, block.from[0] + k), hn::Set(d, p[0]));
  const auto ay = hn::Sub(hn::Load(d, block.from[1] + k), hn::Set(d, p[1]));
  const auto az = hn::Sub(hn::Load(d, block.from[2] + k), hn::Set(d, p[2]));
  const auto ux = hn::Load(d, block.along[0] + k), uy = hn::Load(d, block.along[1] + k),
             uz = hn::Load(d, block.along[2] + k);
  const auto bx = hn::Add(ax, ux), by = hn::Add(ay, uy), bz = hn::Add(az, uz);
  const auto la = hn::Sqrt(Dot(ax, ay, az, ax, ay, az));
  const auto lb = hn::Sqrt(Dot(bx, by, bz, bx, by, bz));
  const auto product = hn::Mul(la, lb);
  const auto share = hn::Div(hn::Mul(hn::Load(d, block.count + k), hn::Add(la, lb)),
                             hn::Mul(product, hn::Add(product, Dot(ax, ay, az, bx, by, bz))));
  // a x u = a x b, with less cancellation
  sums->x = hn::MulAdd(share, hn::Sub(hn::Mul(ay, uz), hn::Mul(az, uy)), sums->x);
  sums->y = hn::MulAdd(share, hn::Sub(hn::Mul(az, ux), hn::Mul(ax, uz)), sums->y);
  sums->z = hn::MulAdd(share, hn::Sub(hn::Mul(ax, uy), hn::Mul(ay, ux)), sums->z);

  const auto one = hn::Set(d, 1.0F);
  const auto where =
      hn::Neg(hn::Mul(Dot(ax, ay, az, ux, uy, uz), hn::Load(d, block.per_length_sq + k)));
  const auto t = hn::Min(hn::Max(where, hn::Zero(d)), one);
  const auto dx = hn::MulAdd(t, ux, ax), dy = hn::MulAdd(t, uy, ay), dz = hn::MulAdd(t, uz, az);
  const auto distance = hn::Sqrt(Dot(dx, dy, dz, dx, dy, dz));
  const auto inverse = hn::Div(one, distance);
  const auto length = hn::Load(d, block.length + k);
  const auto angle = hn::Mul(length, inverse);
  const auto of_edge = hn::Mul(angle, inverse);
  sums->error = hn::MulAdd(of_edge, hn::MulAdd(angle, angle, one), sums->error);
  sums->curvature = hn::MulAdd(of_edge, inverse, sums->curvature);
  sums->nearest = hn::Min(sums->nearest, distance);
}

// Adds the clusters that are far: with R from p to a cluster's centre, U the sum of its edges and M
// their moment, the field of places c + x is
//   (R x U + t - 3 r x (M^T r)) / R^3, with r = R / |R| and t_a = eps_abc M_bc,
// and terms of the second order, which are 3 (radius / nearest)^2 of length / nearest^2 at most:
// the second derivative of 1 / R is 2 / R^3 in any direction, and those of its gradient 6 / R^4.
// @returns bit i: child k + i is near
HWY_INLINE std::uint32_t AddFar(const OpenEdgeNode& node, std::size_t k, const float* p,
                                LaneSums* sums) {
  const FloatTag d;
  const auto x = hn::Sub(hn::Load(d, node.center[0] + k), hn::Set(d, p[0]));
  const auto y = hn::Sub(hn::Load(d, node.center[1] + k), hn::Set(d, p[1]));
  const auto z = hn::Sub(hn::Load(d, node.center[2] + k), hn::Set(d, p[2]));
  const auto distance = hn::Sqrt(Dot(x, y, z, x, y, z));
  const auto radius = hn::Load(d, node.radius + k);
  const auto nearest =
      hn::NegMulAdd(distance, hn::Set(d, kDistanceError), hn::Sub(distance, radius));
  const auto is_far = hn::Gt(nearest, hn::Mul(hn::Set(d, kFar), radius));
  std::uint8_t far_bits[8] = {};
  hn::StoreMaskBits(d, is_far, far_bits);

  const auto one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  const auto inverse = hn::Div(one, distance);
  const auto rx = hn::Mul(x, inverse), ry = hn::Mul(y, inverse), rz = hn::Mul(z, inverse);
  const auto moment = [&](int i, int j) { return hn::Load(d, node.moment[i][j] + k); };
  const auto three = hn::Set(d, -3.0F);
  const auto mx = hn::Mul(three, Dot(rx, ry, rz, moment(0, 0), moment(1, 0), moment(2, 0)));
  const auto my = hn::Mul(three, Dot(rx, ry, rz, moment(0, 1), moment(1, 1), moment(2, 1)));
  const auto mz = hn::Mul(three, Dot(rx, ry, rz, moment(0, 2), moment(1, 2), moment(2, 2)));
  const auto ux = hn::Load(d, node.sum[0] + k), uy = hn::Load(d, node.sum[1] + k),
             uz = hn::Load(d, node.sum[2] + k);
  const auto cross = [](Floats ay, Floats az, Floats by, Floats bz) {
    return hn::MulSub(ay, bz, hn::Mul(az, by));
  };
  const auto fx = hn::Add(hn::Add(cross(y, z, uy, uz), cross(ry, rz, my, mz)),
                          hn::Sub(moment(1, 2), moment(2, 1)));
  const auto fy = hn::Add(hn::Add(cross(z, x, uz, ux), cross(rz, rx, mz, mx)),
                          hn::Sub(moment(2, 0), moment(0, 2)));
  const auto fz = hn::Add(hn::Add(cross(x, y, ux, uy), cross(rx, ry, mx, my)),
                          hn::Sub(moment(0, 1), moment(1, 0)));
  const auto share = hn::IfThenElse(is_far, hn::Mul(inverse, hn::Mul(inverse, inverse)), zero);
  sums->x = hn::MulAdd(share, fx, sums->x);
  sums->y = hn::MulAdd(share, fy, sums->y);
  sums->z = hn::MulAdd(share, fz, sums->z);

  const auto per_nearest = hn::IfThenElse(is_far, hn::Div(one, nearest), zero);
  const auto q = hn::Mul(radius, per_nearest);
  const auto of_edges = hn::Mul(hn::Load(d, node.length + k), hn::Mul(per_nearest, per_nearest));
  const auto wrong = hn::MulAdd(hn::Mul(q, q), hn::Set(d, 3.0F / kFieldError), one);
  sums->error = hn::MulAdd(of_edges, wrong, sums->error);
  sums->curvature = hn::MulAdd(of_edges, per_nearest, sums->curvature);
  sums->nearest =
      hn::Min(sums->nearest,
              hn::IfThenElse(is_far, nearest, hn::Set(d, std::numeric_limits<float>::infinity())));
  return ~static_cast<std::uint32_t>(far_bits[0]) & ((1U << hn::Lanes(d)) - 1U);
}

// Adds the far children of a node. @returns bit i: child i is near
HWY_INLINE std::uint32_t AddFar(const OpenEdgeNode& node, const float* p, LaneSums* sums) {
  std::uint32_t near = 0;
  for (std::size_t k = 0; k < OpenEdgeNode::kChildren; k += hn::Lanes(FloatTag())) {
    near |= AddFar(node, k, p, sums) << k;
  }
  return near;
}

void Sum(const std::vector<OpenEdgeNode>& nodes, const std::vector<OpenEdgeBlock>& blocks,
         const float* p, OpenEdgeSums* sums) {
  std::array<std::int32_t, kStack> stack;
  std::size_t size = 0;
  stack[size++] = static_cast<std::int32_t>(nodes.size() - 1);
  LaneSums lanes;
  lanes.Clear();
  for (int terms = 1; size > 0; ++terms) {
    const std::int32_t next = stack[--size];
    if (next < 0) {
      const OpenEdgeBlock& block = blocks[static_cast<std::size_t>(~next)];
      for (std::size_t k = 0; k < OpenEdgeBlock::kEdges; k += hn::Lanes(FloatTag())) {
        AddEdges(block, k, p, &lanes);
      }
    } else {
      const OpenEdgeNode& node = nodes[static_cast<std::size_t>(next)];
      for (std::uint32_t near = AddFar(node, p, &lanes); near != 0; near &= near - 1) {
        stack[size++] = node.child[hwy::Num0BitsBelowLS1Bit_Nonzero32(near)];
      }
    }
    if (terms % kTerms != 0 && size > 0) continue;
    lanes.AddTo(sums);
    lanes.Clear();
  }
}

}  // namespace open_edges

void SumOpenEdges(const std::vector<OpenEdgeNode>& nodes, const std::vector<OpenEdgeBlock>& blocks,
                  const float* p, OpenEdgeSums* sums) {
  open_edges::Sum(nodes, blocks, p, sums);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(SumOpenEdges);

void sum_open_edges(const std::vector<OpenEdgeNode>& nodes,
                    const std::vector<OpenEdgeBlock>& blocks, const float* p, OpenEdgeSums* sums) {
  HWY_DYNAMIC_DISPATCH(SumOpenEdges)(nodes, blocks, p, sums);
}

}  // namespace ist
#endif
