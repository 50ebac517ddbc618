// Bundles of rays against a TriangleBvh. Compiled once per instruction set; the best one available
// is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/ray_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cmath>
#include <limits>

#include "geometry/ray_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace ray_bundle {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kWidth = TriangleBvh::kWidth;
using FloatTag = hn::CappedTag<float, kWidth>;
using V = hn::Vec<FloatTag>;

// Writes where an interval of parameters begins, infinity where it is empty.
HWY_INLINE void StoreEnter(V first, V last, float* enter) {
  const FloatTag d;
  const V slack = hn::Mul(hn::Set(d, 1e-6F), hn::Add(hn::Abs(first), hn::Abs(last)));
  const V begin = hn::Sub(first, slack);
  hn::Store(hn::IfThenElse(hn::Le(first, hn::Add(last, slack)), begin,
                           hn::Set(d, std::numeric_limits<float>::infinity())),
            d, enter);
}

// The parameters at which the beam enters the children's boxes; infinite where it misses them.
HWY_INLINE void EnterBoxes(const TriangleBvh::Boxes& boxes, const Beam& beam, float* enter) {
  const FloatTag d;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    V first = hn::Zero(d), last = hn::Set(d, beam.last);
    for (std::size_t i = 0; i < 3; ++i) {
      const V low = hn::Set(d, beam.origin[i] + beam.margin),
              high = hn::Set(d, beam.origin[i] - beam.margin);
      const V at_high = hn::Mul(hn::Sub(hn::Load(d, boxes.min[i] + k), low),
                                hn::Set(d, beam.at_high[i].reciprocal));
      const V at_low = hn::Mul(hn::Sub(hn::Load(d, boxes.max[i] + k), high),
                               hn::Set(d, beam.at_low[i].reciprocal));
      if (beam.at_high[i].is_lower) {
        first = hn::Max(first, at_high);
      } else {
        last = hn::Min(last, at_high);
      }
      if (beam.at_low[i].is_lower) {
        first = hn::Max(first, at_low);
      } else {
        last = hn::Min(last, at_low);
      }
    }
    StoreEnter(first, last, enter + k);
  }
}

// The same for a ray.
HWY_INLINE void EnterBoxes(const TriangleBvh::Boxes& boxes, const mesh_ray::FloatRay& ray,
                           float* enter) {
  const FloatTag d;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    V first = hn::Set(d, ray.first), last = hn::Set(d, ray.last);
    for (std::size_t i = 0; i < 3; ++i) {
      const V reciprocal = hn::Set(d, ray.reciprocal[i]);
      const V low = hn::Set(d, ray.origin[i] + ray.margin),
              high = hn::Set(d, ray.origin[i] - ray.margin);
      const V a = hn::Mul(hn::Sub(hn::Load(d, boxes.min[i] + k), low), reciprocal);
      const V b = hn::Mul(hn::Sub(hn::Load(d, boxes.max[i] + k), high), reciprocal);
      first = hn::Max(first, hn::Min(a, b));
      last = hn::Min(last, hn::Max(a, b));
    }
    StoreEnter(first, last, enter + k);
  }
}

struct Vec3 {
  V x, y, z;
};

// d.(a x b)
HWY_INLINE V EdgeFunction(const Vec3& d, const Vec3& a, const Vec3& b) {
  const V x = hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), y = hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          z = hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x));
  return hn::MulAdd(d.x, x, hn::MulAdd(d.y, y, hn::Mul(d.z, z)));
}

// Bit k: the line of the ray may cross triangle k. The edge functions of a triangle that is crossed
// have one sign.
HWY_INLINE std::uint32_t Crossed(const TriangleBvh::Leaf& leaf, const mesh_ray::FloatRay& ray) {
  const FloatTag t;
  const Vec3 d = {hn::Set(t, ray.direction[0]), hn::Set(t, ray.direction[1]),
                  hn::Set(t, ray.direction[2])};
  const Vec3 o = {hn::Set(t, ray.origin[0]), hn::Set(t, ray.origin[1]), hn::Set(t, ray.origin[2])};
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(t)) {
    const auto corner = [&](std::size_t c) {
      return Vec3{hn::Sub(hn::Load(t, leaf.corner[3 * c] + k), o.x),
                  hn::Sub(hn::Load(t, leaf.corner[3 * c + 1] + k), o.y),
                  hn::Sub(hn::Load(t, leaf.corner[3 * c + 2] + k), o.z)};
    };
    const Vec3 a = corner(0), b = corner(1), c = corner(2);
    const V ab = EdgeFunction(d, a, b), bc = EdgeFunction(d, b, c), ca = EdgeFunction(d, c, a);
    const V least = hn::Min(ab, hn::Min(bc, ca)), most = hn::Max(ab, hn::Max(bc, ca));
    const auto hit = hn::Ge(hn::Max(least, hn::Neg(most)), hn::Set(t, -ray.edge_margin));
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(t, hit, bytes);
    bits |= static_cast<std::uint32_t>(bytes[0]) << k;
  }
  return bits & ((1U << leaf.count) - 1U);
}

// Copies a leaf and its box to a slot; those before it are used, those behind it are far away.
void CopyChild(const TriangleBvh::Boxes& from, std::size_t k, TriangleBvh::Boxes* to,
               std::size_t slot) {
  constexpr float kFar = 1e18F;  // [m]
  for (std::size_t i = 0; i < 3; ++i) {
    to->min[i][slot] = from.min[i][k];
    to->max[i][slot] = from.max[i][k];
  }
  to->child[slot] = from.child[k];
  to->count = static_cast<std::int32_t>(slot + 1);
  if (slot != 0) return;
  for (std::size_t rest = 1; rest < kWidth; ++rest) {
    for (std::size_t i = 0; i < 3; ++i) to->min[i][rest] = to->max[i][rest] = kFar;
  }
}

std::size_t FindLeaves(const TriangleBvh::View& bvh, const Beam& beam, TriangleBvh::Boxes* leaves,
                       std::size_t capacity) {
  struct Entry {
    std::int32_t node;
    float enter;
  };
  TriangleBvh::Stack<Entry> stack;
  stack.push({0, 0.0F});
  std::size_t count = 0;
  while (!stack.empty()) {
    const TriangleBvh::Boxes& boxes = bvh.boxes[stack.pop().node];
    alignas(32) float enter[kWidth];
    EnterBoxes(boxes, beam, enter);
    const std::size_t siblings = stack.size();
    for (std::size_t k = 0; k < static_cast<std::size_t>(boxes.count); ++k) {
      if (!std::isfinite(enter[k])) continue;
      if (boxes.child[k] >= 0) {
        stack.push_least_on_top<&Entry::enter>(siblings, {boxes.child[k], enter[k]});
        continue;
      }
      if (count == kWidth * capacity) return count + 1;
      CopyChild(boxes, k, leaves + count / kWidth, count % kWidth);
      ++count;
    }
  }
  return count;
}

TriangleBvh::RayCrossing FindCrossing(const TriangleBvh::View& bvh,
                                      const TriangleBvh::Boxes* leaves, std::size_t count,
                                      const mesh_ray::FloatRay& from, const Eigen::Vector3d& o_M,
                                      const Eigen::Vector3d& d_M, double first, double limit) {
  TriangleBvh::RayCrossing best;
  mesh_ray::FloatRay ray = from;
  for (std::size_t i = 0; i < count; ++i) {
    alignas(32) float enter[kWidth];
    EnterBoxes(leaves[i], ray, enter);
    for (std::size_t k = 0; k < static_cast<std::size_t>(leaves[i].count); ++k) {
      if (!(enter[k] <= ray.last) || !std::isfinite(enter[k])) continue;
      const TriangleBvh::Leaf& leaf = bvh.leaves[~leaves[i].child[k]];
      const std::uint32_t bits = Crossed(leaf, ray);
      for (std::uint32_t j = 0; bits >> j != 0; ++j) {
        if ((bits >> j & 1U) == 0) continue;
        const double t = mesh_ray::cross_triangle(bvh.triangles[leaf.first + j], o_M, d_M);
        if (!(t >= first && t <= limit)) continue;
        limit = t;
        best = {t, leaf.first + j};
        ray.last = mesh_ray::last_of(t);
      }
    }
  }
  return best;
}

}  // namespace ray_bundle

std::size_t FindRayLeaves(const TriangleBvh::View& bvh, const Beam& beam,
                          TriangleBvh::Boxes* leaves, std::size_t capacity) {
  return ray_bundle::FindLeaves(bvh, beam, leaves, capacity);
}

TriangleBvh::RayCrossing FindRayCrossing(const TriangleBvh::View& bvh,
                                         const TriangleBvh::Boxes* leaves, std::size_t count,
                                         const mesh_ray::FloatRay& ray, const Eigen::Vector3d& o_M,
                                         const Eigen::Vector3d& d_M, double first, double limit) {
  return ray_bundle::FindCrossing(bvh, leaves, count, ray, o_M, d_M, first, limit);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindRayLeaves);
HWY_EXPORT(FindRayCrossing);

std::size_t find_leaves(const TriangleBvh::View& bvh, const Beam& beam, TriangleBvh::Boxes* leaves,
                        std::size_t capacity) {
  return HWY_DYNAMIC_DISPATCH(FindRayLeaves)(bvh, beam, leaves, capacity);
}

TriangleBvh::RayCrossing find_crossing(const TriangleBvh::View& bvh,
                                       const TriangleBvh::Boxes* leaves, std::size_t count,
                                       const mesh_ray::FloatRay& ray, const Eigen::Vector3d& o_M,
                                       const Eigen::Vector3d& d_M, double first, double limit) {
  return HWY_DYNAMIC_DISPATCH(FindRayCrossing)(bvh, leaves, count, ray, o_M, d_M, first, limit);
}

}  // namespace ist
#endif
