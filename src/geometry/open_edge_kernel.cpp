// Sums over the open edges of a mesh. Compiled once per instruction set; the best one available is
// chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/open_edge_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/open_edge_blocks.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace open_edges {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, OpenEdgeBlock::kEdges>;
using Floats = hn::Vec<FloatTag>;
// A block counts as one short edge where it is farther than so many of its radii.
constexpr float kFarBlock = 16.0F;
// Float loses no more than this share of an edge's field, where the edge is seen as a point, and
// more with the square of length / distance.
constexpr float kFieldError = 2e-6F;
// Distances are wrong by no more than this share.
constexpr float kDistanceError = 2e-6F;
// Float loses less than this share in a sum of positive terms.
constexpr double kSummed = 1.0 + 1e-3;

HWY_INLINE Floats Dot(Floats ax, Floats ay, Floats az, Floats bx, Floats by, Floats bz) {
  return hn::MulAdd(ax, bx, hn::MulAdd(ay, by, hn::Mul(az, bz)));
}

// Sums of edges, in lanes.
struct LaneSums {
  Floats x, y, z, error, curvature, nearest;
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

// Adds a block that is so far that its edges are seen at its centre.
// @returns whether it is that far
HWY_INLINE bool AddFar(const OpenEdgeBlock& block, const float* p, OpenEdgeSums* sums) {
  const float x = block.center[0] - p[0], y = block.center[1] - p[1], z = block.center[2] - p[2];
  const float distance_sq = x * x + y * y + z * z;
  const float far = (kFarBlock + 1.0F) * block.radius;
  if (!(distance_sq > far * far)) return false;
  const float distance = std::sqrt(distance_sq);
  const float nearest = distance * (1.0F - kDistanceError) - block.radius;
  const float share = 1.0F / (distance_sq * distance);
  const float* v = block.sum_along;
  sums->field[0] += static_cast<double>(share * (y * v[2] - z * v[1]));
  sums->field[1] += static_cast<double>(share * (z * v[0] - x * v[2]));
  sums->field[2] += static_cast<double>(share * (x * v[1] - y * v[0]));
  const float of_edges = block.sum_length / (nearest * nearest);
  sums->field_error +=
      static_cast<double>(of_edges * (2.0F * block.radius / nearest + 4.0F * kFieldError));
  sums->curvature += kSummed * static_cast<double>(2.0F * of_edges / nearest);
  sums->nearest = std::min(sums->nearest, static_cast<double>(nearest));
  return true;
}

void Sum(const std::vector<OpenEdgeBlock>& blocks, const float* p, OpenEdgeSums* sums) {
  const FloatTag d;
  constexpr std::size_t kLanes = hn::MaxLanes(FloatTag());
  constexpr std::size_t kParts = OpenEdgeBlock::kEdges / kLanes;
  const auto zero = hn::Zero(d);
  const auto infinity = hn::Set(d, std::numeric_limits<float>::infinity());
  LaneSums lanes{zero, zero, zero, zero, zero, infinity};
  for (const OpenEdgeBlock& block : blocks) {
    if (AddFar(block, p, sums)) continue;
    for (std::size_t part = 0; part < kParts; ++part) AddEdges(block, part * kLanes, p, &lanes);
  }
  const auto total = [&](Floats v) {
    return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, v)));
  };
  sums->field[0] += total(lanes.x);
  sums->field[1] += total(lanes.y);
  sums->field[2] += total(lanes.z);
  sums->field_error += static_cast<double>(kFieldError) * total(lanes.error);
  sums->curvature += kSummed * 2.0 * total(lanes.curvature);
  sums->nearest = std::min(
      sums->nearest,
      static_cast<double>((1.0F - kDistanceError) * hn::GetLane(hn::MinOfLanes(d, lanes.nearest))));
}

}  // namespace open_edges

void SumOpenEdges(const std::vector<OpenEdgeBlock>& blocks, const float* p, OpenEdgeSums* sums) {
  open_edges::Sum(blocks, p, sums);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(SumOpenEdges);

void sum_open_edges(const std::vector<OpenEdgeBlock>& blocks, const float* p, OpenEdgeSums* sums) {
  HWY_DYNAMIC_DISPATCH(SumOpenEdges)(blocks, p, sums);
}

}  // namespace ist
#endif
