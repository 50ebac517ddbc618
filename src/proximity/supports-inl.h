// How far the children of a tree's node reach. Compiled once per instruction set: to be included
// again for each.
#if defined(IST_PROXIMITY_SUPPORTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_SUPPORTS_INL_H
#undef IST_PROXIMITY_SUPPORTS_INL_H
#else
#define IST_PROXIMITY_SUPPORTS_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "proximity/supports.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SupportTag = hn::CappedTag<float, static_cast<std::size_t>(kSphereWidth)>;

template <class Spheres>
HWY_INLINE hn::Vec<SupportTag> Along(const Spheres& spheres, const float* n, std::size_t k) {
  const SupportTag d;
  return hn::MulAdd(hn::Set(d, n[0]), hn::Load(d, spheres.x + k),
                    hn::MulAdd(hn::Set(d, n[1]), hn::Load(d, spheres.y + k),
                               hn::Mul(hn::Set(d, n[2]), hn::Load(d, spheres.z + k))));
}

// How far a leaf's cover spheres reach, or `most`; but never short of a centre: what planes leave
// of a sphere then has everything that is near the sphere before the plane.
HWY_INLINE float LeafSupport(const SphereLeaf& leaf, const float* n, float most) {
  const SupportTag d;
  const auto nowhere = hn::Set(d, kNowhere);
  auto farthest = nowhere, center = nowhere;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto outer = hn::Load(d, leaf.cover_radius + k), along = Along(leaf, n, k);
    farthest = hn::Max(farthest, hn::Add(along, outer));
    center = hn::Max(center, hn::IfThenElse(hn::Gt(outer, nowhere), along, nowhere));
  }
  const float reach = hn::GetLane(hn::MaxOfLanes(d, farthest));
  if (reach <= most) return reach;
  return std::min(reach, std::max(hn::GetLane(hn::MaxOfLanes(d, center)), most));
}

// Of the children that are nodes, their spheres tell; to ask their leaves would cost more than the
// pairs that it spares. Unused slots reach nowhere.
inline void FindSupports(const SphereNode& node, const SphereLeaf* leaves, const Supports& supports,
                         float* reach) {
  const SupportTag d;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto most = hn::Set(d, supports.most);
    const auto sphere = hn::Add(Along(node, supports.normal, k), hn::Load(d, node.radius + k));
    hn::StoreU(hn::Max(hn::Min(sphere, most), hn::Set(d, kNowhere)), d, reach + k);
  }
  for (int k = 0; k < node.count; ++k) {
    if (node.child[k] >= 0) continue;
    reach[k] = LeafSupport(leaves[~node.child[k]], supports.normal, supports.most);
  }
}

// A node reaches no farther than its children.
HWY_INLINE void Tighten(const float* children, float* reach) {
  const SupportTag d;
  auto farthest = hn::Set(d, kNowhere);
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    farthest = hn::Max(farthest, hn::LoadU(d, children + k));
  }
  *reach = std::min(*reach, hn::GetLane(hn::MaxOfLanes(d, farthest)));
}

// Of the children of a node, by child.
HWY_INLINE const float* SupportsOf(std::int32_t node, const SphereNode* nodes,
                                   const SphereLeaf* leaves, Supports* supports) {
  const auto i = static_cast<std::size_t>(node);
  float* reach = supports->reach.data() + i * static_cast<std::size_t>(kSphereWidth);
  if (supports->found[i] != supports->aims) {
    supports->found[i] = supports->aims;
    FindSupports(nodes[node], leaves, *supports, reach);
  }
  return reach;
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_SUPPORTS_INL_H
