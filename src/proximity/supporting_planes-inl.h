// Supports of the children of a tree's node. Compiled once per instruction set: to be included
// again for each.
#if defined(IST_PROXIMITY_SUPPORTING_PLANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_SUPPORTING_PLANES_INL_H
#undef IST_PROXIMITY_SUPPORTING_PLANES_INL_H
#else
#define IST_PROXIMITY_SUPPORTING_PLANES_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "proximity/supporting_planes.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace dual_tree {
namespace hn = hwy::HWY_NAMESPACE;

using SphereTag = hn::CappedTag<float, static_cast<std::size_t>(kSphereWidth)>;

// n . c of the centres of spheres.
template <class Spheres>
HWY_INLINE hn::Vec<SphereTag> AlongNormal(const Spheres& spheres, const float* n, std::size_t k) {
  const SphereTag d;
  return hn::MulAdd(hn::Set(d, n[0]), hn::Load(d, spheres.x + k),
                    hn::MulAdd(hn::Set(d, n[1]), hn::Load(d, spheres.y + k),
                               hn::Mul(hn::Set(d, n[2]), hn::Load(d, spheres.z + k))));
}

// The support of a leaf's cover spheres, or `max_support` where that is less; but never less than
// that of a centre: so whatever is near a clipped sphere is above the plane (ClippedDistance).
HWY_INLINE float LeafSupport(const SphereLeaf& leaf, const float* n, float max_support) {
  const SphereTag d;
  const auto none = hn::Set(d, kNoSupport);
  auto sphere = none, center = none;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto radius = hn::Load(d, leaf.cover_radius + k), along = AlongNormal(leaf, n, k);
    sphere = hn::Max(sphere, hn::Add(along, radius));
    center = hn::Max(center, hn::IfThenElse(hn::Gt(radius, none), along, none));
  }
  const float support = hn::GetLane(hn::MaxOfLanes(d, sphere));
  if (support <= max_support) return support;
  return std::min(support, std::max(hn::GetLane(hn::MaxOfLanes(d, center)), max_support));
}

// Supports of a node's children. Inner nodes are bounded by their bounding spheres: to visit their
// leaves would cost more than the pairs that it prunes.
inline void ComputeSupports(const SphereNode& node, const SphereLeaf* leaves,
                            const SupportCache& cache, float* support) {
  const SphereTag d;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto sphere = hn::Add(AlongNormal(node, cache.normal, k), hn::Load(d, node.radius + k));
    hn::StoreU(hn::Max(hn::Min(sphere, hn::Set(d, cache.max_support)), hn::Set(d, kNoSupport)), d,
               support + k);
  }
  for (int k = 0; k < node.count; ++k) {
    if (node.child[k] >= 0) continue;
    support[k] = LeafSupport(leaves[~node.child[k]], cache.normal, cache.max_support);
  }
}

// Lowers a node's support to the largest of its children's.
HWY_INLINE void TightenSupport(const float* children, float* support) {
  const SphereTag d;
  auto largest = hn::Set(d, kNoSupport);
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    largest = hn::Max(largest, hn::LoadU(d, children + k));
  }
  *support = std::min(*support, hn::GetLane(hn::MaxOfLanes(d, largest)));
}

// Supports of the children of a node, by child.
HWY_INLINE const float* SupportsOf(std::int32_t node, const SphereNode* nodes,
                                   const SphereLeaf* leaves, SupportCache* cache) {
  const auto i = static_cast<std::size_t>(node);
  float* support = cache->support.data() + i * static_cast<std::size_t>(kSphereWidth);
  if (cache->computed_for[i] != cache->direction_id) {
    cache->computed_for[i] = cache->direction_id;
    ComputeSupports(nodes[node], leaves, *cache, support);
  }
  return support;
}

}  // namespace dual_tree
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_SUPPORTING_PLANES_INL_H
