// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/index/tile_split_kernel.cpp"
#include "cloud/index/tile_split_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <limits>

#include "cloud/index/split_rule.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace tile_split {
namespace hn = hwy::HWY_NAMESPACE;

using SlotTag = hn::CappedTag<float, static_cast<std::size_t>(kPointWidth)>;
constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
constexpr float kInfinity = std::numeric_limits<float>::infinity();

HWY_INLINE hn::Mask<SlotTag> MaskOf(std::uint32_t slots) {
  const std::uint8_t bits[8] = {static_cast<std::uint8_t>(slots),
                                static_cast<std::uint8_t>(slots >> 8U)};
  return hn::LoadMaskBits(SlotTag(), bits);
}

HWY_INLINE std::uint32_t Below(const float* values, float limit) {
  const SlotTag d;
  std::uint32_t slots = 0;
  for (std::size_t k = 0; k < kSlots; k += hn::Lanes(d)) {
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Lt(hn::Load(d, values + k), hn::Set(d, limit)), bits);
    slots |= (bits[0] | static_cast<std::uint32_t>(bits[1]) << 8U) << k;
  }
  return slots;
}

HWY_INLINE void Extent(const float* values, std::uint32_t slots, float* min, float* max) {
  const SlotTag d;
  auto least = hn::Set(d, kInfinity), most = hn::Set(d, -kInfinity);
  for (std::size_t k = 0; k < kSlots; k += hn::Lanes(d)) {
    const auto mask = MaskOf(slots >> k);
    const auto v = hn::Load(d, values + k);
    least = hn::Min(least, hn::IfThenElse(mask, v, least));
    most = hn::Max(most, hn::IfThenElse(mask, v, most));
  }
  *min = hn::GetLane(hn::MinOfLanes(d, least));
  *max = hn::GetLane(hn::MaxOfLanes(d, most));
}

HWY_INLINE PaddedBox BoxOf(const PointTile& tile, std::uint32_t slots) {
  float min[4] = {}, max[4] = {};
  Extent(tile.x, slots, &min[0], &max[0]);
  Extent(tile.y, slots, &min[1], &max[1]);
  Extent(tile.z, slots, &min[2], &max[2]);
  return {{min[0], min[1], min[2], 0.0F}, {max[0], max[1], max[2], 0.0F}};
}

void HalveTile(const PointTile& tile, std::uint32_t points, const PaddedBox& box,
               TileHalves* halves) {
  const int axis =
      longest_axis(box.max[0] - box.min[0], box.max[1] - box.min[1], box.max[2] - box.min[2]);
  const float middle = 0.5F * (box.min[axis] + box.max[axis]);
  const float* along = axis == 0 ? tile.x : axis == 1 ? tile.y : tile.z;
  halves->low = Below(along, middle) & points;
  halves->high = points & ~halves->low;
  halves->low_box = BoxOf(tile, halves->low);
  halves->high_box = BoxOf(tile, halves->high);
}

}  // namespace tile_split

using tile_split::HalveTile;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(HalveTile);

TileHalves halve_tile(const PointTile& tile, std::uint32_t points, const PaddedBox& box) {
  TileHalves halves;
  HWY_DYNAMIC_DISPATCH(HalveTile)(tile, points, box, &halves);
  return halves;
}

void pick_points(const PointTile& from, std::uint32_t points, PointTile* to) {
  std::int32_t n = 0;
  for (; points != 0; points &= points - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(points);
    to->x[n] = from.x[k];
    to->y[n] = from.y[k];
    to->z[n] = from.z[k];
    to->id[n] = from.id[k];
    ++n;
  }
  to->count = n;
}

}  // namespace ist
#endif
