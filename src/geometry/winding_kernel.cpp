// Generalized winding number of a TriangleBvh (Barill et al. 2018). Compiled once per instruction
// set; the best one available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/winding_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cmath>

#include "geometry/triangle_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace winding_number {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kWidth = TriangleBvh::kWidth;
using FloatTag = hn::CappedTag<float, kWidth>;

// A sum of angles in each lane, as a product of their phasors: one arctangent for many small
// angles.
struct Angles {
  alignas(32) float re[kWidth], im[kWidth];
  double sum = 0.0;  // [rad] angles and products that were added up in double instead

  Angles() {
    for (std::size_t k = 0; k < kWidth; ++k) {
      re[k] = 1.0F;
      im[k] = 0.0F;
    }
  }
};

template <class V>
HWY_INLINE V Dot(V ax, V ay, V az, V bx, V by, V bz) {
  return hn::MulAdd(ax, bx, hn::MulAdd(ay, by, hn::Mul(az, bz)));
}

// Half the solid angle of a triangle in double.
double HalfAngle(const TriangleBvh::Triangle& triangle, const Eigen::Vector3d& p) {
  const Eigen::Vector3d a = triangle.a - p, b = triangle.b - p, c = triangle.c - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double det = a.dot((triangle.b - triangle.a).cross(triangle.c - triangle.a));
  if (det == 0.0) return 0.0;  // in the plane, as in AddTriangles
  return std::atan2(det, la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

// A phasor smaller than this share of the lengths' product is the difference of much larger terms:
// a sliver seen from nearby, or a point next to an edge. In float its sign would be random.
constexpr float kCancelled = 1e-3F;
// Float moves a corner or a point by less than 2e-7 of the hierarchy's radius, and a phasor by that
// times the products of two lengths. A phasor that is no larger than so many times its error is
// computed in double.
constexpr double kCornerError = 2e-7, kTimesError = 100.0;

// The terms of all lanes of a vector.
struct LaneTerms {
  alignas(64) float re[kWidth], im[kWidth];            // phasor of the triangle's angle
  alignas(64) float is_precise[kWidth], fits[kWidth];  // 1 or 0
};

// Adds the terms that do not fit into a lane's product, and that product, to the sum in double.
void AddInDouble(const TriangleBvh::View& bvh, const TriangleBvh::Leaf& leaf,
                 const Eigen::Vector3d& p_M, std::size_t k, const LaneTerms& terms,
                 Angles* angles) {
  for (std::size_t lane = 0; lane < hn::Lanes(FloatTag()); ++lane) {
    if (terms.fits[lane] != 0.0F) continue;
    if (terms.is_precise[lane] != 0.0F) {
      angles->sum +=
          std::atan2(static_cast<double>(terms.im[lane]), static_cast<double>(terms.re[lane]));
    } else if (k + lane < leaf.count) {
      angles->sum += HalfAngle(bvh.triangles[leaf.first + k + lane], p_M);
    }
    angles->sum += std::atan2(static_cast<double>(angles->im[k + lane]),
                              static_cast<double>(angles->re[k + lane]));
  }
}

// Adds half the solid angle of each triangle, as a phasor (van Oosterom and Strackee 1983). A half
// angle of more than 90 degrees is computed in double: its point is so near the triangle that the
// side of the plane decides between inside and outside.
HWY_INLINE void AddTriangles(const TriangleBvh::View& bvh, const TriangleBvh::Leaf& leaf,
                             const Eigen::Vector3d& p_M, const float* p, Angles* angles) {
  const FloatTag d;
  const auto lost = hn::Set(d, static_cast<float>(kTimesError * kCornerError * bvh.radius));
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const auto px = hn::Set(d, p[0]), py = hn::Set(d, p[1]), pz = hn::Set(d, p[2]);
    const auto load = [&](int row) { return hn::Load(d, leaf.corner[row] + k); };
    const auto ax = hn::Sub(load(0), px), ay = hn::Sub(load(1), py), az = hn::Sub(load(2), pz);
    const auto bx = hn::Sub(load(3), px), by = hn::Sub(load(4), py), bz = hn::Sub(load(5), pz);
    const auto cx = hn::Sub(load(6), px), cy = hn::Sub(load(7), py), cz = hn::Sub(load(8), pz);
    const auto la = hn::Sqrt(Dot(ax, ay, az, ax, ay, az));
    const auto lb = hn::Sqrt(Dot(bx, by, bz, bx, by, bz));
    const auto lc = hn::Sqrt(Dot(cx, cy, cz, cx, cy, cz));
    // b x c
    const auto nx = hn::Sub(hn::Mul(by, cz), hn::Mul(bz, cy));
    const auto ny = hn::Sub(hn::Mul(bz, cx), hn::Mul(bx, cz));
    const auto nz = hn::Sub(hn::Mul(bx, cy), hn::Mul(by, cx));
    const auto det = Dot(ax, ay, az, nx, ny, nz);
    const auto lab = hn::Mul(la, lb), lengths = hn::Mul(lab, lc);
    const auto areas = hn::MulAdd(hn::Add(la, lb), lc, lab);
    const auto side =
        hn::Add(lengths, hn::MulAdd(Dot(ax, ay, az, bx, by, bz), lc,
                                    hn::MulAdd(Dot(bx, by, bz, cx, cy, cz), la,
                                               hn::Mul(Dot(cx, cy, cz, ax, ay, az), lb))));
    // Unit phasors, so that products stay in range; nothing where the point is in the plane.
    const auto zero = hn::Zero(d);
    const auto size = hn::Add(hn::Abs(det), hn::Abs(side));
    const auto is_something = hn::Ne(det, zero);
    const auto least = hn::MulAdd(lost, areas, hn::Mul(hn::Set(d, kCancelled), lengths));
    const auto is_precise = hn::And(hn::Ge(size, least), hn::Gt(side, zero));
    const auto scale =
        hn::Div(hn::Set(d, 1.0F), hn::IfThenElse(is_something, size, hn::Set(d, 1.0F)));
    const auto re = hn::IfThenElse(is_something, hn::Mul(side, scale), hn::Set(d, 1.0F));
    const auto im = hn::IfThenElse(is_something, hn::Mul(det, scale), zero);
    const auto old_re = hn::Load(d, angles->re + k), old_im = hn::Load(d, angles->im + k);
    auto new_re = hn::Sub(hn::Mul(old_re, re), hn::Mul(old_im, im));
    auto new_im = hn::MulAdd(old_re, im, hn::Mul(old_im, re));
    // While both are below a right angle the sum cannot wrap. Otherwise both go to the sum in
    // double.
    const auto fits = hn::And(is_precise, hn::And(hn::Gt(re, zero), hn::Gt(new_re, zero)));
    if (!hn::AllTrue(d, fits)) {
      LaneTerms terms;
      hn::Store(re, d, terms.re);
      hn::Store(im, d, terms.im);
      hn::Store(hn::IfThenElse(is_precise, hn::Set(d, 1.0F), zero), d, terms.is_precise);
      hn::Store(hn::IfThenElse(fits, hn::Set(d, 1.0F), zero), d, terms.fits);
      AddInDouble(bvh, leaf, p_M, k, terms, angles);
      new_re = hn::IfThenElse(fits, new_re, hn::Set(d, 1.0F));
      new_im = hn::IfThenElse(fits, new_im, zero);
    }
    const auto norm = hn::Div(hn::Set(d, 1.0F), hn::Add(hn::Abs(new_re), hn::Abs(new_im)));
    hn::Store(hn::Mul(new_re, norm), d, angles->re + k);
    hn::Store(hn::Mul(new_im, norm), d, angles->im + k);
  }
}

// Adds the expansions of those children of a node that are far from p, and marks the others: they
// are `near`.
// @param sizes  the terms' absolute values are added to it
HWY_INLINE void AddExpansions(const TriangleBvh::Moments& node, const float* p, float beta_sq,
                              float* sums, float* sizes, float* near) {
  const FloatTag d;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const auto dx = hn::Sub(hn::Load(d, node.x + k), hn::Set(d, p[0]));
    const auto dy = hn::Sub(hn::Load(d, node.y + k), hn::Set(d, p[1]));
    const auto dz = hn::Sub(hn::Load(d, node.z + k), hn::Set(d, p[2]));
    const auto distance_sq = Dot(dx, dy, dz, dx, dy, dz);
    const auto is_far =
        hn::Gt(distance_sq, hn::Mul(hn::Set(d, beta_sq), hn::Load(d, node.radius_sq + k)));
    const auto inverse = hn::Div(hn::Set(d, 1.0F), hn::Sqrt(distance_sq));
    const auto inverse_sq = hn::Mul(inverse, inverse);
    const auto qxx = hn::Load(d, node.qxx + k), qyy = hn::Load(d, node.qyy + k),
               qzz = hn::Load(d, node.qzz + k);
    const auto qxy = hn::Load(d, node.qxy + k), qxz = hn::Load(d, node.qxz + k),
               qyz = hn::Load(d, node.qyz + k);
    const auto dipole = Dot(dx, dy, dz, hn::Load(d, node.nx + k), hn::Load(d, node.ny + k),
                            hn::Load(d, node.nz + k));
    const auto qdx = Dot(qxx, qxy, qxz, dx, dy, dz);
    const auto qdy = Dot(qxy, qyy, qyz, dx, dy, dz);
    const auto qdz = Dot(qxz, qyz, qzz, dx, dy, dz);
    const auto dqd = Dot(dx, dy, dz, qdx, qdy, qdz);
    const auto trace = hn::Add(qxx, hn::Add(qyy, qzz));
    const auto moments =
        hn::Add(dipole, hn::NegMulAdd(hn::Mul(hn::Set(d, 3.0F), inverse_sq), dqd, trace));
    const auto term = hn::Mul(moments, hn::Mul(inverse, inverse_sq));
    const auto far_term = hn::IfThenElse(is_far, term, hn::Zero(d));
    hn::Store(hn::Add(hn::Load(d, sums + k), far_term), d, sums + k);
    hn::Store(hn::Add(hn::Load(d, sizes + k), hn::Abs(far_term)), d, sizes + k);
    hn::Store(hn::IfThenElse(is_far, hn::Zero(d), hn::Set(d, 1.0F)), d, near + k);
  }
}

WindingSum Sum(const TriangleBvh::View& bvh, const Eigen::Vector3d& p_M, float beta) {
  const Eigen::Vector3d local = p_M - bvh.origin;
  const float p[3] = {static_cast<float>(local.x()), static_cast<float>(local.y()),
                      static_cast<float>(local.z())};
  TriangleBvh::Stack<std::int32_t> stack;
  stack.push(0);
  Angles angles;
  alignas(32) float far_sums[kWidth] = {}, far_sizes[kWidth] = {};
  while (!stack.empty()) {
    const std::int32_t index = stack.pop();
    alignas(64) float near[kWidth];
    AddExpansions(bvh.moments[index], p, beta * beta, far_sums, far_sizes, near);
    // Unused slots have no child: a NaN, which makes them near, must not lead back to the root.
    const auto count = static_cast<std::size_t>(bvh.boxes[index].count);
    for (std::size_t k = 0; k < count; ++k) {
      if (near[k] == 0.0F) continue;
      const std::int32_t child = bvh.boxes[index].child[k];
      if (child < 0) {
        AddTriangles(bvh, bvh.leaves[~child], p_M, p, &angles);
      } else {
        stack.push(child);
      }
    }
  }
  double near_sum = angles.sum, far_sum = 0.0, far_size = 0.0;
  for (std::size_t k = 0; k < kWidth; ++k) {
    near_sum += std::atan2(static_cast<double>(angles.im[k]), static_cast<double>(angles.re[k]));
    far_sum += static_cast<double>(far_sums[k]);
    far_size += static_cast<double>(far_sizes[k]);
  }
  constexpr double kFourPi = 12.566370614359172;
  return {(far_sum + 2.0 * near_sum) / kFourPi, far_size / kFourPi};
}

}  // namespace winding_number

WindingSum SumWinding(const TriangleBvh::View& bvh, const Eigen::Vector3d& p_M, float beta) {
  return winding_number::Sum(bvh, p_M, beta);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(SumWinding);

WindingSum sum_winding(const TriangleBvh::View& bvh, const Eigen::Vector3d& p_M, float beta) {
  return HWY_DYNAMIC_DISPATCH(SumWinding)(bvh, p_M, beta);
}

}  // namespace ist
#endif
