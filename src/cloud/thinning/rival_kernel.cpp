// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/thinning/rival_kernel.cpp"
#include "cloud/thinning/rival_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace rival {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, kPointWidth>;
using V = hn::Vec<Tag>;

// Bit k: child k meets the box of all spheres.
HWY_INLINE std::uint32_t ChildrenNear(const BoxNode& node, const RivalSpheres& spheres) {
  const Tag d;
  std::uint32_t near = 0;
  const auto off = [d](const float* min, const float* max, float low, float high) {
    return hn::Max(hn::Sub(hn::Load(d, min), hn::Set(d, high)),
                   hn::Sub(hn::Set(d, low), hn::Load(d, max)));
  };
  for (std::size_t k = 0; k < kBoxWidth; k += hn::Lanes(d)) {
    const V off_all =
        hn::Max(hn::Max(off(node.min_x + k, node.max_x + k, spheres.min[0], spheres.max[0]),
                        off(node.min_y + k, node.max_y + k, spheres.min[1], spheres.max[1])),
                off(node.min_z + k, node.max_z + k, spheres.min[2], spheres.max[2]));
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Le(off_all, hn::Zero(d)), bits);
    near |= (bits[0] | static_cast<std::uint32_t>(bits[1]) << 8U) << k;
  }
  return near & ((1U << static_cast<std::uint32_t>(node.count)) - 1U);
}

HWY_INLINE V Off(float min, float max, const float* v) {
  const Tag d;
  const V place = hn::Load(d, v);
  return hn::Max(hn::Max(hn::Sub(hn::Set(d, min), place), hn::Sub(place, hn::Set(d, max))),
                 hn::Zero(d));
}

HWY_INLINE float LeastGap(const BoxNode& node, std::size_t child, const RivalSpheres& spheres) {
  const Tag d;
  V least = hn::Set(d, kFarAway);
  for (std::size_t i = 0; i < spheres.count; i += hn::Lanes(d)) {
    const V x = Off(node.min_x[child], node.max_x[child], &spheres.x[i]);
    const V y = Off(node.min_y[child], node.max_y[child], &spheres.y[i]);
    const V z = Off(node.min_z[child], node.max_z[child], &spheres.z[i]);
    // Products and sums are rounded one by one, so that all instruction sets agree.
    const V squared = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
    least = hn::Min(least, hn::Sub(squared, hn::Load(d, &spheres.radius_sq[i])));
  }
  return hn::GetLane(hn::MinOfLanes(d, least));
}

std::uint32_t FindRivalChildren(const BoxNode& node, const RivalSpheres& spheres, float* gaps) {
  std::uint32_t found = 0;
  for (std::uint32_t near = ChildrenNear(node, spheres); near != 0; near &= near - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(near);
    gaps[k] = LeastGap(node, k, spheres);
    if (gaps[k] <= 0.0F) found |= near & (0U - near);
  }
  return found;
}

}  // namespace rival

using rival::FindRivalChildren;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindRivalChildren);

std::uint32_t find_rival_children(const BoxNode& node, const RivalSpheres& spheres, float* gaps) {
  return HWY_DYNAMIC_DISPATCH(FindRivalChildren)(node, spheres, gaps);
}

}  // namespace ist
#endif
