// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/closest_kernel.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/slab_reach-inl.h"
#include "geometry/triangle_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kTriangleWidth = TriangleBvh::kWidth;
using TriangleTag = hn::CappedTag<float, kTriangleWidth>;

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

// Distances to eight triangles: to the plane where the point projects inside, else to an edge.
HWY_INLINE void TriangleDistancesSq(const TriangleBvh::Leaf& leaf, const float* p, float* out) {
  const TriangleTag d;
  using V = hn::Vec<TriangleTag>;
  for (std::size_t k = 0; k < kTriangleWidth; k += hn::Lanes(d)) {
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
    const auto zero = hn::Zero(d);
    const auto inside = hn::And(
        hn::Le(Dot3(Cross(ab, n), va), zero),
        hn::And(hn::Le(Dot3(Cross(bc, n), vb), zero), hn::Le(Dot3(Cross(ca, n), vc), zero)));
    const V height = Dot3(n, va);
    const V plane = hn::Div(hn::Mul(height, height), hn::Max(Dot3(n, n), hn::Set(d, 1e-30F)));
    hn::Store(hn::IfThenElse(inside, hn::Min(plane, edges), edges), d, out + k);
  }
}

class Closest {
 public:
  Closest(const TriangleBvh::View& tree, const Eigen::Vector3d& p, double max_sq,
          const Eigen::Vector3d& toward, double enough_sq, double slack, ClosestPoint* result)
      : tree_(tree),
        p_(p),
        best_sq_(max_sq),
        enough_sq_(enough_sq),
        slack_(slack),
        result_(*result) {
    const Eigen::Vector3d local = p - tree.origin;
    for (int axis = 0; axis < 3; ++axis) p_float_[axis] = static_cast<float>(local[axis]);
    // What float loses, in distance.
    rounding_ = 2e-6 * (local.norm() + tree.radius);
    Tighten();
    Aim(toward);
  }

  void Run() {
    Entry stack[512];
    std::size_t top = 0;
    stack[top++] = {0, 0.0F};
    while (top > 0) {
      const Entry entry = stack[--top];
      if (LeftOut(entry.distance_sq)) continue;
      if (entry.child < 0) {
        Visit(tree_.leaves[~entry.child]);
        if (result_.distance_sq > enough_sq_) continue;
        result_.lower_bound = 0.0;
        return;
      }
      const TriangleBvh::Boxes& boxes = tree_.boxes[entry.child];
      alignas(32) float distance_sq[kTriangleWidth];
      ChildDistancesSq(boxes, tree_.slabs[entry.child], distance_sq);
      const std::size_t begin = top;
      for (int k = 0; k < boxes.count; ++k) {
        if (LeftOut(distance_sq[k])) continue;
        Prefetch(boxes.child[k]);
        std::size_t at = top++;  // nearest on top
        for (; at > begin && stack[at - 1].distance_sq < distance_sq[k]; --at)
          stack[at] = stack[at - 1];
        stack[at] = {boxes.child[k], distance_sq[k]};
      }
    }
    if (!(result_.distance_sq < std::numeric_limits<double>::infinity())) return;
    const double nearest = std::sqrt(result_.distance_sq);
    result_.lower_bound = nearest;
    if (slack_ > 0.0) {
      const double left_out = std::sqrt(static_cast<double>(left_out_sq_)) - rounding_;
      result_.lower_bound = std::clamp(left_out, std::max(nearest - slack_, 0.0), nearest);
    }
  }

 private:
  struct Entry {
    std::int32_t child;
    float distance_sq;
  };

  // What is looked at next, most likely: meshes are larger than caches near the core.
  HWY_INLINE void Prefetch(std::int32_t child) const {
    if (child < 0) {
      PrefetchLines(&tree_.leaves[~child], sizeof(TriangleBvh::Leaf));
    } else {
      PrefetchLines(&tree_.boxes[child], sizeof(TriangleBvh::Boxes));
      PrefetchLines(&tree_.slabs[child], sizeof(TriangleBvh::Slabs));
    }
  }
  static HWY_INLINE void PrefetchLines(const void* begin, std::size_t size) {
    const auto* bytes = static_cast<const char*>(begin);
    for (std::size_t i = 0; i < size; i += 64) hwy::Prefetch(bytes + i);
  }

  // Whether what is this far does not matter.
  HWY_INLINE bool LeftOut(float distance_sq) {
    if (!(distance_sq > limit_sq_)) return false;
    left_out_sq_ = std::min(left_out_sq_, distance_sq);
    return true;
  }

  void Tighten() {
    double limit = std::sqrt(best_sq_) + rounding_;
    if (result_.distance_sq <= best_sq_) limit = std::max(limit - slack_, rounding_);
    limit_sq_ = static_cast<float>(std::min(1.00001 * limit * limit, 1e30));
  }

  // What is seen from p lies at least as far as it is along any direction: triangles aside of the
  // nearest one are told by that, though their boxes reach as near.
  void Aim(const Eigen::Vector3d& toward) {
    for (int axis = 0; axis < 3; ++axis) toward_[axis] = static_cast<float>(toward[axis]);
    height_ = toward_[0] * p_float_[0] + toward_[1] * p_float_[1] + toward_[2] * p_float_[2];
  }

  // Whether all triangles of a leaf are too far along that direction.
  HWY_INLINE bool IsBeyond(const TriangleBvh::Leaf& leaf) {
    const TriangleTag d;
    auto reach = hn::Set(d, std::numeric_limits<float>::lowest());
    for (std::size_t k = 0; k < kTriangleWidth; k += hn::Lanes(d)) {
      const auto along = [&](int row) {
        return hn::MulAdd(
            hn::Set(d, toward_[0]), hn::Load(d, leaf.corner[row] + k),
            hn::MulAdd(hn::Set(d, toward_[1]), hn::Load(d, leaf.corner[row + 1] + k),
                       hn::Mul(hn::Set(d, toward_[2]), hn::Load(d, leaf.corner[row + 2] + k))));
      };
      reach = hn::Max(reach, hn::Max(along(0), hn::Max(along(3), along(6))));
    }
    const float ahead = height_ - hn::GetLane(hn::MaxOfLanes(d, reach));
    return ahead > 0.0F && LeftOut(ahead * ahead);
  }

  // As far as boxes and slabs tell.
  HWY_INLINE void ChildDistancesSq(const TriangleBvh::Boxes& boxes, const TriangleBvh::Slabs& slabs,
                                   float* out) const {
    const TriangleTag d;
    for (std::size_t k = 0; k < kTriangleWidth; k += hn::Lanes(d)) {
      auto sum = hn::Zero(d);
      for (int axis = 0; axis < 3; ++axis) {
        const auto p = hn::Set(d, p_float_[axis]);
        const auto low = hn::Sub(hn::Load(d, boxes.min[axis] + k), p);
        const auto high = hn::Sub(p, hn::Load(d, boxes.max[axis] + k));
        const auto gap = hn::Max(hn::Max(low, high), hn::Zero(d));
        sum = hn::MulAdd(gap, gap, sum);
      }
      const auto along = hn::Sub(hn::Set(d, height_), Reach(boxes, slabs, toward_, k));
      const auto ahead = hn::Max(along, hn::Zero(d));
      hn::Store(hn::Max(sum, hn::Mul(ahead, ahead)), d, out + k);
    }
  }

  // Float decides which triangles can be nearest, double which one is.
  void Visit(const TriangleBvh::Leaf& leaf) {
    if (IsBeyond(leaf)) return;
    alignas(32) float distance_sq[kTriangleWidth];
    TriangleDistancesSq(leaf, p_float_, distance_sq);
    std::uint32_t nearest = 0;
    for (std::uint32_t k = 1; k < leaf.count; ++k) {
      if (distance_sq[k] < distance_sq[nearest]) nearest = k;
    }
    if (LeftOut(distance_sq[nearest])) return;
    Measure(tree_.triangles[leaf.first + nearest]);
    for (std::uint32_t k = 0; k < leaf.count; ++k) {
      if (k != nearest && !LeftOut(distance_sq[k])) Measure(tree_.triangles[leaf.first + k]);
    }
  }

  void Measure(const TriangleBvh::Triangle& triangle) {
    const Eigen::Vector3d q = closest_point_on_triangle(p_, triangle.a, triangle.b, triangle.c);
    const double exact_sq = (q - p_).squaredNorm();
    const bool is_first = result_.distance_sq == std::numeric_limits<double>::infinity();
    if (!(exact_sq < best_sq_ || (is_first && exact_sq == best_sq_))) return;
    best_sq_ = exact_sq;
    result_.point = q;
    result_.distance_sq = exact_sq;
    result_.triangle = triangle.index;
    Tighten();
    if (exact_sq > 0.0) Aim((p_ - q) / std::sqrt(exact_sq));
  }

  const TriangleBvh::View& tree_;
  const Eigen::Vector3d& p_;
  float p_float_[3];
  double best_sq_;
  double enough_sq_, slack_;
  double rounding_;
  float limit_sq_ = 0.0F;
  float left_out_sq_ = std::numeric_limits<float>::max();  // least of all that was
  float toward_[3];
  float height_;  // of p along that
  ClosestPoint& result_;
};

void FindClosest(const TriangleBvh::View& tree, const Eigen::Vector3d& p, double max_distance_sq,
                 const Eigen::Vector3d& toward, double enough_sq, double slack,
                 ClosestPoint* closest) {
  Closest(tree, p, max_distance_sq, toward, enough_sq, slack, closest).Run();
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindClosest);

void find_closest(const TriangleBvh::View& tree, const Eigen::Vector3d& p_M, double max_distance_sq,
                  const Eigen::Vector3d& toward_M, double enough_sq, double slack,
                  ClosestPoint* closest) {
  HWY_DYNAMIC_DISPATCH(FindClosest)
  (tree, p_M, max_distance_sq, toward_M, enough_sq, slack, closest);
}

}  // namespace ist
#endif
