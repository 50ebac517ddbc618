// Pairs of a sphere node and a box node, and lower bounds of the distances of their children.
// Compiled once per instruction set: to be included again for each.
#if defined(IST_PROXIMITY_PAIR_BOUNDS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_PAIR_BOUNDS_INL_H
#undef IST_PROXIMITY_PAIR_BOUNDS_INL_H
#else
#define IST_PROXIMITY_PAIR_BOUNDS_INL_H
#endif

#include <hwy/highway.h>

#include <cmath>

#include "proximity/clipped_sphere-inl.h"
#include "proximity/dual_tree.h"
#include "proximity/supporting_planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace dual_tree {
namespace hn = hwy::HWY_NAMESPACE;

// A pair of a tree node's child and a box. It carries both volumes, so that expanding one side does
// not touch the other's memory.
struct Pair {
  float bound;               // [m] lower bound of the distance
  std::int32_t sphere_slot;  // BvttFront::Pair::sphere
  std::int32_t box_slot;     // BvttFront::Pair::box
  std::int32_t parent;       // in the front: kBoxWidth * pair + child; or one of those below
  std::int32_t sphere, box;  // children: >= 0 node, < 0 leaf or tile
  float x, y, z, radius;     // the bounding sphere, posed
  float min[3], max[3];
};

inline bool BoxIsLarger(const Pair& pair) {
  float size_sq = 0.0F;
  for (int i = 0; i < 3; ++i) {
    size_sq += (pair.max[i] - pair.min[i]) * (pair.max[i] - pair.min[i]);
  }
  return size_sq > 4.0F * pair.radius * pair.radius;
}

// The sphere through the corners of a pair's box.
struct BoxSphere {
  float x, y, z, radius;
};
inline BoxSphere CircumscribedSphere(const Pair& pair) {
  float size_sq = 0.0F;
  for (int i = 0; i < 3; ++i) {
    size_sq += (pair.max[i] - pair.min[i]) * (pair.max[i] - pair.min[i]);
  }
  return {0.5F * (pair.min[0] + pair.max[0]), 0.5F * (pair.min[1] + pair.max[1]),
          0.5F * (pair.min[2] + pair.max[2]), 0.5F * std::sqrt(size_sq)};
}

// Centres of eight spheres in the index's frame [m].
struct PosedCenters {
  alignas(64) float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth];
};

template <class Bvh>
HWY_INLINE void PoseCenters(const DualTreeInput<Bvh>& input, const float* x, const float* y,
                            const float* z, PosedCenters* posed) {
  const SphereTag d;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto vx = hn::Load(d, x + k), vy = hn::Load(d, y + k), vz = hn::Load(d, z + k);
    float* out[3] = {posed->x, posed->y, posed->z};
    for (int row = 0; row < 3; ++row) {
      const float* r = input.R_OL + 3 * row;
      const auto sum =
          hn::MulAdd(hn::Set(d, r[0]), vx,
                     hn::MulAdd(hn::Set(d, r[1]), vy,
                                hn::MulAdd(hn::Set(d, r[2]), vz, hn::Set(d, input.p_OL[row]))));
      hn::Store(sum, d, out[row] + k);
    }
  }
}

// Moves the children whose bits are set far away.
template <class D>
HWY_INLINE hn::Vec<D> MaskOut(D d, hn::Vec<D> bound, std::uint32_t bits) {
  if (bits == 0) return bound;
  alignas(64) float far[kBoxWidth];
  for (std::size_t k = 0; k < hn::Lanes(d); ++k) {
    far[k] = ((bits >> k) & 1U) != 0 ? kFarAway : -kFarAway;
  }
  return hn::Max(bound, hn::Load(d, far));
}

// The children of a pair whose lower bounds are below a limit.
struct ChildrenBelow {
  std::uint32_t bits;  // bit k: child k
  float pruned_bound;  // [m] least lower bound of the others
};

// Bit k for a bound below the limit; the least of the others goes to `pruned`. Unused slots are far
// away. (Vectors are no class members: those of some instruction sets have no size.)
template <class D, class V>
HWY_INLINE std::uint32_t BitsBelow(D d, V bound, float limit, V* pruned) {
  const auto below = hn::Lt(bound, hn::Set(d, limit));
  *pruned = hn::Min(*pruned, hn::IfThenElse(below, *pruned, bound));
  return MaskBits(d, below);
}

template <class D>
HWY_INLINE ChildrenBelow Children(D d, std::uint32_t bits, int count, std::uint32_t skipped,
                                  hn::Vec<D> pruned) {
  const std::uint32_t used = (1U << static_cast<std::uint32_t>(count)) - 1U;
  return {bits & used & ~skipped, hn::GetLane(hn::MinOfLanes(d, pruned))};
}

// Lower bounds of the pairs of a node's children with the pair's box: by their bounding spheres,
// and by those spheres clipped at the children's supporting planes.
// @param skipped  bit k: child k is left out
// @param bound    [m] of all children, overwritten
HWY_INLINE ChildrenBelow BoundSphereChildren(const Pair& pair, const SphereNode& node,
                                             const PosedCenters& centers, const float* support,
                                             const PlaneFrame& planes, float rounding, float limit,
                                             std::uint32_t skipped, float* bound) {
  const SphereTag d;
  const auto box_height = hn::Set(d, planes.Height(pair.min, pair.max));
  const BoxSphere box = CircumscribedSphere(pair);
  auto pruned = hn::Set(d, kFarAway);
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto x = hn::Load(d, centers.x + k), y = hn::Load(d, centers.y + k),
               z = hn::Load(d, centers.z + k), radius = hn::Load(d, node.radius + k);
    const auto dx = IntervalDistance(d, hn::Set(d, pair.min[0]), hn::Set(d, pair.max[0]), x);
    const auto dy = IntervalDistance(d, hn::Set(d, pair.min[1]), hn::Set(d, pair.max[1]), y);
    const auto dz = IntervalDistance(d, hn::Set(d, pair.min[2]), hn::Set(d, pair.max[2]), z);
    const auto child_support = hn::LoadU(d, support + k);
    const auto sphere_bound = hn::Sub(Norm(dx, dy, dz), radius);
    const auto plane_height = hn::Sub(hn::Add(hn::Set(d, planes.offset()), child_support),
                                      planes.AlongNormal(d, x, y, z));
    const auto lateral =
        hn::Sub(planes.Lateral(d, hn::Sub(hn::Set(d, box.x), x), hn::Sub(hn::Set(d, box.y), y),
                               hn::Sub(hn::Set(d, box.z), z)),
                hn::Set(d, box.radius));
    const auto clipped_bound =
        ClippedDistance(d, hn::Sub(box_height, child_support), hn::Max(lateral, hn::Zero(d)),
                        radius, plane_height, RimRadius(d, radius, plane_height, rounding));
    const auto least = hn::Max(sphere_bound, clipped_bound);
    hn::Store(least, d, bound + k);
    bits |= BitsBelow(d, MaskOut(d, least, skipped >> k), limit, &pruned) << k;
  }
  return Children(d, bits, node.count, skipped, pruned);
}

// The same for the pairs of the pair's sphere with the children of its box.
// @param support  [m] of the sphere's node
HWY_INLINE ChildrenBelow BoundBoxChildren(const Pair& pair, const BoxNode& node, float support,
                                          const PlaneFrame& planes, float rounding, float limit,
                                          std::uint32_t skipped, float* bound) {
  const BoxTag d;
  const float plane_offset = planes.offset() + support;
  const float center[3] = {pair.x, pair.y, pair.z};
  const auto radius = hn::Set(d, pair.radius);
  const auto plane_height =
      hn::Sub(hn::Set(d, plane_offset),
              planes.AlongNormal(d, hn::Set(d, pair.x), hn::Set(d, pair.y), hn::Set(d, pair.z)));
  const auto rim_radius = RimRadius(d, radius, plane_height, rounding);
  auto pruned = hn::Set(d, kFarAway);
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
    const auto sphere_bound = hn::Sub(Distance(node, k, pair.x, pair.y, pair.z), radius);
    const auto clipped_bound =
        ClippedDistance(d, planes.Height(node, k, plane_offset), planes.Lateral(node, k, center),
                        radius, plane_height, rim_radius);
    const auto least = hn::Max(sphere_bound, clipped_bound);
    hn::Store(least, d, bound + k);
    bits |= BitsBelow(d, MaskOut(d, least, skipped >> k), limit, &pruned) << k;
  }
  return Children(d, bits, node.count, skipped, pruned);
}

}  // namespace dual_tree
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_PAIR_BOUNDS_INL_H
