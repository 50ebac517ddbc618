// The test of a sphere of points against the spheres of a tree. Compiled once per instruction set;
// the best one available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/filters/sphere_verdict_kernel.cpp"
#include "cloud/filters/sphere_verdict_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "internal/tree/sphere_tree_stack.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace sphere_verdict {
namespace hn = hwy::HWY_NAMESPACE;

constexpr auto kWidth = static_cast<std::size_t>(kSphereWidth);
using SphereTag = hn::CappedTag<float, kWidth>;

// Squared radius [m^2] of spheres k and following, which grow by `margin` [m], less the squared
// distance of the point from their centres: positive where the point is within. Products and sums
// are rounded one by one, so that every instruction set finds the same.
template <class Spheres>
HWY_INLINE hn::Vec<SphereTag> Inside(const Spheres& spheres, const float* radii, std::size_t k,
                                     const float* p, float margin) {
  const SphereTag d;
  const auto dx = hn::Sub(hn::Load(d, spheres.x + k), hn::Set(d, p[0]));
  const auto dy = hn::Sub(hn::Load(d, spheres.y + k), hn::Set(d, p[1]));
  const auto dz = hn::Sub(hn::Load(d, spheres.z + k), hn::Set(d, p[2]));
  const auto limit = hn::Max(hn::Add(hn::Load(d, radii + k), hn::Set(d, margin)), hn::Zero(d));
  const auto distance_sq = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
  return hn::Sub(hn::Mul(limit, limit), distance_sq);
}

HWY_INLINE bool IsInAny(const SphereLeaf& leaf, const float* radii, const float* p, float margin) {
  const SphereTag d;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    if (!hn::AllFalse(d, hn::Gt(Inside(leaf, radii, k, p, margin), hn::Zero(d)))) return true;
  }
  return false;
}

struct Entry {
  std::int32_t child;
  float inside;  // [m^2] of its bounding sphere
};

SphereVerdict TestSpheres(const SphereNode* nodes, const SphereLeaf* leaves, const float* p,
                          float near, float held, bool stop_undecided) {
  const SphereTag d;
  SphereTreeStack<Entry> stack;
  stack.push({0, 0.0F});
  SphereVerdict verdict = SphereVerdict::kClear;
  while (!stack.empty()) {
    const std::int32_t child = stack.pop().child;
    if (child < 0) {
      const SphereLeaf& leaf = leaves[~child];
      if (IsInAny(leaf, leaf.inner_radius, p, held)) return SphereVerdict::kOnRobot;
      if (verdict == SphereVerdict::kClear && IsInAny(leaf, leaf.cover_radius, p, near)) {
        verdict = SphereVerdict::kUndecided;
        if (stop_undecided) return verdict;
      }
      continue;
    }
    // Once it is undecided, only an inner sphere can decide: it lies in the bounding sphere.
    const SphereNode& node = nodes[child];
    const float margin = verdict == SphereVerdict::kClear ? near : held;
    alignas(32) float inside[kSphereWidth];
    for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
      hn::Store(Inside(node, node.radius, k, p, margin), d, inside + k);
    }
    const std::size_t first = stack.size();
    for (int k = 0; k < node.count; ++k) {
      if (!(inside[k] > 0.0F)) continue;
      stack.push_greatest_on_top<&Entry::inside>(first, {node.child[k], inside[k]});
    }
  }
  return verdict;
}

}  // namespace sphere_verdict

using sphere_verdict::TestSpheres;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(TestSpheres);

SphereVerdict test_spheres(const InnerSphereTree& tree, const float center_L[3], float near,
                           float held, bool stop_undecided) {
  return HWY_DYNAMIC_DISPATCH(TestSpheres)(tree.nodes().data(), tree.leaves().data(), center_L,
                                           near, held, stop_undecided);
}

}  // namespace ist
#endif
