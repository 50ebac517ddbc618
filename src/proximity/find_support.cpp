// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/find_support.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

#include "proximity/traversal.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SupportTag = hn::CappedTag<float, static_cast<std::size_t>(kSphereWidth)>;

// How far a leaf's outer balls reach, or `most`; but never short of a centre: what planes leave of
// a ball then has everything that is near the ball before the plane.
float LeafSupport(const SphereLeaf& leaf, const float* n, float most) {
  const SupportTag d;
  const auto nx = hn::Set(d, n[0]), ny = hn::Set(d, n[1]), nz = hn::Set(d, n[2]);
  const auto nowhere = hn::Set(d, kNowhere);
  auto farthest = nowhere, center = nowhere;
  for (std::size_t b = 0; b < static_cast<std::size_t>(kSphereWidth); b += hn::Lanes(d)) {
    const auto outer = hn::Load(d, leaf.outer + b);
    const auto along =
        hn::MulAdd(nx, hn::Load(d, leaf.x + b),
                   hn::MulAdd(ny, hn::Load(d, leaf.y + b), hn::Mul(nz, hn::Load(d, leaf.z + b))));
    farthest = hn::Max(farthest, hn::Add(along, outer));
    center = hn::Max(center, hn::IfThenElse(hn::Gt(outer, nowhere), along, nowhere));
  }
  const float reach = hn::GetLane(hn::MaxOfLanes(d, farthest));
  if (reach <= most) return reach;
  return std::min(reach, std::max(hn::GetLane(hn::MaxOfLanes(d, center)), most));
}

// Nodes follow their parents. Unused slots reach nowhere: balls by their radius, children by what
// `support` is filled with.
void FindSupport(const InnerSphereTree& tree, const float* n, float most, float* support) {
  const SupportTag d;
  for (std::size_t i = tree.nodes().size(); i-- > 0;) {
    const SphereNode& node = tree.nodes()[i];
    float* here = support + i * static_cast<std::size_t>(kSphereWidth);
    for (int k = 0; k < node.count; ++k) {
      const std::int32_t child = node.child[k];
      if (child < 0) {
        here[k] = LeafSupport(tree.leaves()[static_cast<std::size_t>(~child)], n, most);
        continue;
      }
      auto farthest = hn::Set(d, -kFarAway);
      for (std::size_t b = 0; b < static_cast<std::size_t>(kSphereWidth); b += hn::Lanes(d)) {
        farthest = hn::Max(farthest, hn::LoadU(d, support + child * kSphereWidth + b));
      }
      here[k] = hn::GetLane(hn::MaxOfLanes(d, farthest));
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindSupport);

void find_support(const InnerSphereTree& tree, const float n[3], float most, float* support) {
  HWY_DYNAMIC_DISPATCH(FindSupport)(tree, n, most, support);
}

}  // namespace ist
#endif
