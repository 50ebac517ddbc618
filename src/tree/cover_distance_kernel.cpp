// The test of a point against all cover spheres of a tree. Compiled once per instruction set; the
// best one available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tree/cover_distance_kernel.cpp"
#include "tree/cover_distance_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "internal/tree/sphere_tree_stack.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace cover_distance {
namespace hn = hwy::HWY_NAMESPACE;

constexpr auto kWidth = static_cast<std::size_t>(kSphereWidth);
using SphereTag = hn::CappedTag<float, kWidth>;

// The power [m^2] of a point with respect to spheres k and following, whose radii grow by `margin`
// [m]: squared distance of the centre less squared radius, > 0 outside. An unused slot, whose
// radius is far below 0, has a power of at least 1 m^2.
template <class Spheres>
HWY_INLINE hn::Vec<SphereTag> Power(const Spheres& spheres, const float* radii, std::size_t k,
                                    const float* p, float margin) {
  const SphereTag d;
  const auto dx = hn::Sub(hn::Load(d, spheres.x + k), hn::Set(d, p[0]));
  const auto dy = hn::Sub(hn::Load(d, spheres.y + k), hn::Set(d, p[1]));
  const auto dz = hn::Sub(hn::Load(d, spheres.z + k), hn::Set(d, p[2]));
  const auto radius =
      hn::Max(hn::Add(hn::Load(d, radii + k), hn::Set(d, margin)), hn::Set(d, -1.0F));
  const auto distance_sq = hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz)));
  return hn::NegMulAdd(radius, hn::Abs(radius), distance_sq);
}

struct Entry {
  std::int32_t child;
  float power;  // [m^2] with respect to its bounding sphere
};

bool Exceeds(const SphereNode* nodes, const SphereLeaf* leaves, const float* p, float distance) {
  const SphereTag d;
  SphereTreeStack<Entry> stack;
  stack.push({0, 0.0F});
  while (!stack.empty()) {
    const Entry entry = stack.pop();
    if (entry.child < 0) {
      const SphereLeaf& leaf = leaves[~entry.child];
      for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
        const auto power = Power(leaf, leaf.cover_radius, k, p, distance);
        if (!hn::AllTrue(d, hn::Gt(power, hn::Zero(d)))) return false;
      }
      continue;
    }
    const SphereNode& node = nodes[entry.child];
    alignas(32) float power[kSphereWidth];
    for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
      hn::Store(Power(node, node.radius, k, p, distance), d, power + k);
    }
    const std::size_t first = stack.size();
    for (int k = 0; k < node.count; ++k) {
      if (power[k] > 0.0F) continue;
      stack.push_least_on_top<&Entry::power>(first, {node.child[k], power[k]});
    }
  }
  return true;
}

}  // namespace cover_distance

bool CoverDistanceExceeds(const SphereNode* nodes, const SphereLeaf* leaves, const float* p,
                          float distance) {
  return cover_distance::Exceeds(nodes, leaves, p, distance);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(CoverDistanceExceeds);

bool cover_distance_exceeds(const SphereNode* nodes, const SphereLeaf* leaves, const float p_L[3],
                            float distance) {
  return HWY_DYNAMIC_DISPATCH(CoverDistanceExceeds)(nodes, leaves, p_L, distance);
}

}  // namespace ist
#endif
