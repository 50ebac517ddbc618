// Closest point on a TriangleBvh, by branch and bound. Compiled once per instruction set; the best
// one available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/closest_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/child_support-inl.h"
#include "geometry/triangle_kernels.h"
#include "internal/bvh/prefetch.h"
#include "internal/geometry/closest_point_on_triangle.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace closest_point {
namespace hn = hwy::HWY_NAMESPACE;
using triangle_bvh::FloatTag;

constexpr std::size_t kWidth = TriangleBvh::kWidth;

// Squared sine of the angle between two edges below which the normal is not certain in float.
constexpr float kLeastSineSq = 0.25F;

template <class V>
struct Vec3 {
  V x, y, z;
};

template <class V>
HWY_INLINE V Dot3(const Vec3<V>& a, const Vec3<V>& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}

template <class V>
HWY_INLINE Vec3<V> Minus(const Vec3<V>& a, const Vec3<V>& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

template <class V>
HWY_INLINE Vec3<V> Cross(const Vec3<V>& a, const Vec3<V>& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
          hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}

// Squared distance from the segment s + t e, t in [0, 1], to the point s + v.
template <class D, class V>
HWY_INLINE V SegmentSq(D d, const Vec3<V>& e, const Vec3<V>& v) {
  const V length_sq = hn::Max(Dot3(e, e), hn::Set(d, 1e-30F));
  const V t = hn::Min(hn::Max(hn::Div(Dot3(e, v), length_sq), hn::Zero(d)), hn::Set(d, 1.0F));
  const Vec3<V> r{hn::NegMulAdd(t, e.x, v.x), hn::NegMulAdd(t, e.y, v.y),
                  hn::NegMulAdd(t, e.z, v.z)};
  return Dot3(r, r);
}

// A lower bound of a triangle's squared distance that needs no normal. No point of the triangle is
// farther from its edges than the radius of its inscribed circle, half its height at most. So its
// squared distance is no less than that to its edges minus the square of that radius.
template <class D, class V>
HWY_INLINE V LeastFromEdges(D d, V edges, V n_sq, V longest_sq, float rounding) {
  const V half_height = hn::Mul(hn::Set(d, 0.5F), hn::Sqrt(hn::Div(n_sq, longest_sq)));
  const V radius = hn::Add(half_height, hn::Set(d, rounding));
  return hn::Max(hn::NegMulAdd(radius, radius, edges), hn::Zero(d));
}

// Lower bounds [m^2] of the squared distances from p to the triangles of a leaf: to a triangle's
// plane where p projects inside it, else to its nearest edge. The error in distance stays below
// `rounding`: the normal is taken at the corner that is opposite the longest edge, where float
// turns it by no more than 12 roundings (2^-24 rad each) if that corner's angle is between 30 and
// 150 degrees. Height and side of an edge are then wrong by no more than 26 roundings of |p - a|,
// and `rounding` is 33 of more than that. No decision is taken by a normal that is less certain.
HWY_INLINE void TriangleDistancesSq(const TriangleBvh::Leaf& leaf, const float* p, float rounding,
                                    float* out) {
  const FloatTag d;
  using V = hn::Vec<FloatTag>;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const auto corner = [&](int row) {
      return Vec3<V>{hn::Load(d, leaf.corner[row] + k), hn::Load(d, leaf.corner[row + 1] + k),
                     hn::Load(d, leaf.corner[row + 2] + k)};
    };
    const Vec3<V> point{hn::Set(d, p[0]), hn::Set(d, p[1]), hn::Set(d, p[2])};
    const Vec3<V> a = corner(0), b = corner(3), c = corner(6);
    const Vec3<V> ab = Minus(b, a), bc = Minus(c, b), ca = Minus(a, c);
    const Vec3<V> va = Minus(point, a), vb = Minus(point, b), vc = Minus(point, c);
    const Vec3<V> n = Cross(ca, ab);
    const V edges =
        hn::Min(SegmentSq(d, ab, va), hn::Min(SegmentSq(d, bc, vb), SegmentSq(d, ca, vc)));
    // Barycentric coordinates of c, b and a, times n.n.
    const auto zero = hn::Zero(d);
    const Vec3<V> along = Cross(va, n);
    const V n_sq = Dot3(n, n), of_c = Dot3(ab, along), of_b = Dot3(ca, along);
    const auto inside =
        hn::And(hn::Ge(hn::Min(of_b, of_c), zero), hn::Le(hn::Add(of_b, of_c), n_sq));
    const V height = Dot3(n, va);
    const V plane = hn::Div(hn::Mul(height, height), hn::Max(n_sq, hn::Set(d, 1e-30F)));
    V least = hn::IfThenElse(inside, hn::Min(plane, edges), edges);
    const auto is_uncertain =
        hn::Lt(n_sq, hn::Mul(hn::Set(d, kLeastSineSq), hn::Mul(Dot3(ab, ab), Dot3(ca, ca))));
    if (HWY_UNLIKELY(!hn::AllFalse(d, is_uncertain))) {
      const V longest_sq = hn::Max(Dot3(bc, bc), hn::Set(d, 1e-30F));
      least =
          hn::IfThenElse(is_uncertain, LeastFromEdges(d, edges, n_sq, longest_sq, rounding), least);
    }
    hn::Store(least, d, out + k);
  }
}

class ClosestPointSearch {
 public:
  ClosestPointSearch(const TriangleBvh::View& bvh, const Eigen::Vector3d& p, double max_sq,
                     const Eigen::Vector3d& outward_hint, double early_out_sq, double tolerance,
                     ClosestPoint* result)
      : bvh_(bvh),
        p_(p),
        best_sq_(max_sq),
        early_out_sq_(early_out_sq),
        tolerance_(tolerance),
        result_(*result) {
    const Eigen::Vector3d local = p - bvh.origin;
    for (int axis = 0; axis < 3; ++axis) p_float_[axis] = static_cast<float>(local[axis]);
    // Float's error, in distance.
    rounding_ = 2e-6 * (local.norm() + bvh.radius);
    rounding_float_ = static_cast<float>(rounding_);
    UpdatePruneBound();
    SetOutward(outward_hint);
  }

  void Run() {
    TriangleBvh::Stack<Entry> stack;
    stack.push({0, 0.0F});
    while (!stack.empty()) {
      const Entry entry = stack.pop();
      if (Prune(entry.distance_sq)) continue;
      if (entry.child < 0) {
        VisitLeaf(bvh_.leaves[~entry.child]);
        if (result_.distance_sq > early_out_sq_) continue;
        result_.lower_bound = 0.0;
        return;
      }
      const TriangleBvh::Boxes& boxes = bvh_.boxes[entry.child];
      alignas(32) float distance_sq[kWidth];
      ChildDistancesSq(boxes, bvh_.slabs[entry.child], distance_sq);
      const std::size_t first = stack.size();
      for (int k = 0; k < boxes.count; ++k) {
        if (Prune(distance_sq[k])) continue;
        Prefetch(boxes.child[k]);
        stack.push_least_on_top<&Entry::distance_sq>(first, {boxes.child[k], distance_sq[k]});
      }
    }
    if (!(result_.distance_sq < std::numeric_limits<double>::infinity())) return;
    const double nearest = std::sqrt(result_.distance_sq);
    result_.lower_bound = nearest;
    if (tolerance_ > 0.0) {
      const double pruned = std::sqrt(static_cast<double>(least_pruned_sq_)) - rounding_;
      result_.lower_bound = std::clamp(pruned, std::max(nearest - tolerance_, 0.0), nearest);
    }
  }

 private:
  struct Entry {
    std::int32_t child;
    float distance_sq;  // [m^2] lower bound
  };

  // Loads the memory that is most likely visited next.
  HWY_INLINE void Prefetch(std::int32_t child) const {
    if (child < 0) {
      prefetch_lines(&bvh_.leaves[~child], sizeof(TriangleBvh::Leaf));
    } else {
      prefetch_lines(&bvh_.boxes[child], sizeof(TriangleBvh::Boxes));
      prefetch_lines(&bvh_.slabs[child], sizeof(TriangleBvh::Slabs));
    }
  }

  // Whether a part of the surface with this lower bound need not be visited.
  HWY_INLINE bool Prune(float distance_sq) {
    if (!(distance_sq > prune_bound_sq_)) return false;
    least_pruned_sq_ = std::min(least_pruned_sq_, distance_sq);
    return true;
  }

  void UpdatePruneBound() {
    double bound = std::sqrt(best_sq_) + rounding_;
    if (result_.distance_sq <= best_sq_) bound = std::max(bound - tolerance_, rounding_);
    prune_bound_sq_ = static_cast<float>(std::min(1.00001 * bound * bound, 1e30));
  }

  // A second lower bound: a part of the surface is at least as far from p as its supporting plane
  // perpendicular to `outward` is. It prunes triangles beside the closest one, whose boxes may be
  // as near as that.
  void SetOutward(const Eigen::Vector3d& outward) {
    for (int axis = 0; axis < 3; ++axis) outward_[axis] = static_cast<float>(outward[axis]);
    height_ = outward_[0] * p_float_[0] + outward_[1] * p_float_[1] + outward_[2] * p_float_[2];
  }

  // Whether the supporting plane of a leaf's triangles is too far.
  HWY_INLINE bool PruneByPlane(const TriangleBvh::Leaf& leaf) {
    const FloatTag d;
    auto support = hn::Set(d, std::numeric_limits<float>::lowest());
    for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
      const auto along = [&](int row) {
        return hn::MulAdd(
            hn::Set(d, outward_[0]), hn::Load(d, leaf.corner[row] + k),
            hn::MulAdd(hn::Set(d, outward_[1]), hn::Load(d, leaf.corner[row + 1] + k),
                       hn::Mul(hn::Set(d, outward_[2]), hn::Load(d, leaf.corner[row + 2] + k))));
      };
      support = hn::Max(support, hn::Max(along(0), hn::Max(along(3), along(6))));
    }
    const float above_plane = height_ - hn::GetLane(hn::MaxOfLanes(d, support));
    return above_plane > 0.0F && Prune(above_plane * above_plane);
  }

  // Lower bounds [m^2] from boxes and supporting planes.
  HWY_INLINE void ChildDistancesSq(const TriangleBvh::Boxes& boxes, const TriangleBvh::Slabs& slabs,
                                   float* out) const {
    const FloatTag d;
    for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
      auto sum = hn::Zero(d);
      for (int axis = 0; axis < 3; ++axis) {
        const auto p = hn::Set(d, p_float_[axis]);
        const auto low = hn::Sub(hn::Load(d, boxes.min[axis] + k), p);
        const auto high = hn::Sub(p, hn::Load(d, boxes.max[axis] + k));
        const auto gap = hn::Max(hn::Max(low, high), hn::Zero(d));
        sum = hn::MulAdd(gap, gap, sum);
      }
      const auto support = triangle_bvh::ChildSupport(boxes, slabs, outward_, k);
      const auto above_plane = hn::Max(hn::Sub(hn::Set(d, height_), support), hn::Zero(d));
      hn::Store(hn::Max(sum, hn::Mul(above_plane, above_plane)), d, out + k);
    }
  }

  // Float decides which triangles can be nearest, double which one is.
  void VisitLeaf(const TriangleBvh::Leaf& leaf) {
    if (PruneByPlane(leaf)) return;
    alignas(32) float distance_sq[kWidth];
    TriangleDistancesSq(leaf, p_float_, rounding_float_, distance_sq);
    std::uint32_t nearest = 0;
    for (std::uint32_t k = 1; k < leaf.count; ++k) {
      if (distance_sq[k] < distance_sq[nearest]) nearest = k;
    }
    if (Prune(distance_sq[nearest])) return;
    VisitTriangle(bvh_.triangles[leaf.first + nearest]);
    for (std::uint32_t k = 0; k < leaf.count; ++k) {
      if (k != nearest && !Prune(distance_sq[k])) VisitTriangle(bvh_.triangles[leaf.first + k]);
    }
  }

  void VisitTriangle(const TriangleBvh::Triangle& triangle) {
    const Eigen::Vector3d q = closest_point_on_triangle(p_, triangle.a, triangle.b, triangle.c);
    const double exact_sq = (q - p_).squaredNorm();
    const bool is_first = result_.distance_sq == std::numeric_limits<double>::infinity();
    if (!(exact_sq < best_sq_ || (is_first && exact_sq == best_sq_))) return;
    best_sq_ = exact_sq;
    result_.point = q;
    result_.distance_sq = exact_sq;
    result_.triangle = triangle.index;
    result_.slot = static_cast<std::uint32_t>(&triangle - bvh_.triangles);
    UpdatePruneBound();
    if (exact_sq > 0.0) SetOutward((p_ - q) / std::sqrt(exact_sq));
  }

  const TriangleBvh::View& bvh_;
  const Eigen::Vector3d& p_;
  float p_float_[3];  // [m] from the centre of the mesh's bounding box
  double best_sq_;    // [m^2] upper bound
  double early_out_sq_, tolerance_;
  double rounding_;
  float rounding_float_;
  float prune_bound_sq_ = 0.0F;
  float least_pruned_sq_ = std::numeric_limits<float>::max();
  float outward_[3];  // unit, or zero
  float height_;      // [m] of p along it
  ClosestPoint& result_;
};

}  // namespace closest_point

void FindClosest(const TriangleBvh::View& bvh, const Eigen::Vector3d& p, double max_distance_sq,
                 const Eigen::Vector3d& outward_hint, double early_out_sq, double tolerance,
                 ClosestPoint* closest) {
  closest_point::ClosestPointSearch(bvh, p, max_distance_sq, outward_hint, early_out_sq, tolerance,
                                    closest)
      .Run();
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindClosest);

void find_closest(const TriangleBvh::View& bvh, const Eigen::Vector3d& p_M, double max_distance_sq,
                  const Eigen::Vector3d& outward_hint_M, double early_out_sq, double tolerance,
                  ClosestPoint* closest) {
  HWY_DYNAMIC_DISPATCH(FindClosest)
  (bvh, p_M, max_distance_sq, outward_hint_M, early_out_sq, tolerance, closest);
}

}  // namespace ist
#endif
