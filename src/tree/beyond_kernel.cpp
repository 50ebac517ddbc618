// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tree/beyond_kernel.cpp"
#include "tree/beyond_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SphereTag = hn::CappedTag<float, static_cast<std::size_t>(kSphereWidth)>;

// Of a point to spheres that are larger by the margin: [m^2] above 0 outside. Unused slots, whose
// radius is far below 0, count as points a metre farther away.
template <class Spheres>
HWY_INLINE hn::Vec<SphereTag> Power(const Spheres& spheres, const float* radii, std::size_t k,
                                    const float* p, float margin) {
  const SphereTag d;
  const auto dx = hn::Sub(hn::Load(d, spheres.x + k), hn::Set(d, p[0]));
  const auto dy = hn::Sub(hn::Load(d, spheres.y + k), hn::Set(d, p[1]));
  const auto dz = hn::Sub(hn::Load(d, spheres.z + k), hn::Set(d, p[2]));
  const auto reach =
      hn::Max(hn::Add(hn::Load(d, radii + k), hn::Set(d, margin)), hn::Set(d, -1.0F));
  const auto distance_sq = hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz)));
  return hn::NegMulAdd(reach, hn::Abs(reach), distance_sq);
}

bool IsBeyondSpheres(const SphereNode* nodes, const SphereLeaf* leaves, const float* p,
                     float margin) {
  const SphereTag d;
  struct Entry {
    std::int32_t child;
    float power;  // [m^2] of its sphere
  };
  Entry stack[kSphereWidth * kMaxTreeLevels];
  std::size_t top = 0;
  stack[top++] = {0, 0.0F};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.child < 0) {
      const SphereLeaf& leaf = leaves[~entry.child];
      for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
        const auto power = Power(leaf, leaf.cover_radius, k, p, margin);
        if (!hn::AllTrue(d, hn::Gt(power, hn::Zero(d)))) return false;
      }
      continue;
    }
    const SphereNode& node = nodes[entry.child];
    alignas(32) float power[kSphereWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
      hn::Store(Power(node, node.radius, k, p, margin), d, power + k);
    }
    const std::size_t begin = top;
    for (int k = 0; k < node.count; ++k) {
      if (power[k] > 0.0F) continue;
      std::size_t at = top++;  // the deepest entered on top
      for (; at > begin && stack[at - 1].power < power[k]; --at) stack[at] = stack[at - 1];
      stack[at] = {node.child[k], power[k]};
    }
  }
  return true;
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(IsBeyondSpheres);

bool cover_distance_exceeds_spheres(const SphereNode* nodes, const SphereLeaf* leaves,
                                    const float p_L[3], float margin) {
  return HWY_DYNAMIC_DISPATCH(IsBeyondSpheres)(nodes, leaves, p_L, margin);
}

}  // namespace ist
#endif
