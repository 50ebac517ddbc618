// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/image_kernel.cpp"
#include "cloud/image_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using PixelTag = hn::CappedTag<float, kTileColumns>;

// The least (or greatest) of each four neighbours, in all four of their places.
template <class V, class Of>
HWY_INLINE void StoreOfFour(V v, const Of& of, float* to) {
  const PixelTag d;
#if HWY_TARGET != HWY_SCALAR
  v = of(v, hn::Shuffle2301(v));
  v = of(v, hn::Shuffle1032(v));
  hn::Store(v, d, to);
#else  // one at a time; the fourth column is the last to come
  float* four = to - (reinterpret_cast<std::uintptr_t>(to) / sizeof(float)) % kTileSide;
  hn::Store(four == to ? v : of(v, hn::Load(d, four)), d, four);
#endif
}

void FindTileBoxes(const CropBlock* rows, std::size_t column, TileBoxes* boxes) {
  const PixelTag d;
  const auto high = hn::Set(d, std::numeric_limits<float>::infinity());
  const auto low = hn::Neg(high);
  const auto least = [](auto a, auto b) { return hn::Min(a, b); };
  const auto greatest = [](auto a, auto b) { return hn::Max(a, b); };
  for (std::uint32_t& kept : boxes->kept) kept = 0;
  for (std::size_t k = 0; k < kTileColumns; k += hn::Lanes(d)) {
    auto min_x = high, min_y = high, min_z = high, max_x = low, max_y = low, max_z = low;
    for (std::size_t row = 0; row < kTileSide; ++row) {
      const auto x = hn::Load(d, rows[row].x + column + k);
      const auto y = hn::Load(d, rows[row].y + column + k);
      const auto z = hn::Load(d, rows[row].z + column + k);
      const auto kept = hn::Eq(x, x);
      min_x = hn::Min(min_x, hn::IfThenElse(kept, x, high));
      min_y = hn::Min(min_y, hn::IfThenElse(kept, y, high));
      min_z = hn::Min(min_z, hn::IfThenElse(kept, z, high));
      max_x = hn::Max(max_x, hn::IfThenElse(kept, x, low));
      max_y = hn::Max(max_y, hn::IfThenElse(kept, y, low));
      max_z = hn::Max(max_z, hn::IfThenElse(kept, z, low));
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(d, kept, bits);
      boxes->kept[row] |= (bits[0] | static_cast<std::uint32_t>(bits[1]) << 8) << k;
    }
    StoreOfFour(min_x, least, boxes->min[0] + k);
    StoreOfFour(min_y, least, boxes->min[1] + k);
    StoreOfFour(min_z, least, boxes->min[2] + k);
    StoreOfFour(max_x, greatest, boxes->max[0] + k);
    StoreOfFour(max_y, greatest, boxes->max[1] + k);
    StoreOfFour(max_z, greatest, boxes->max[2] + k);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindTileBoxes);

void tile_boxes(const CropBlock* rows, std::size_t column, TileBoxes* boxes) {
  HWY_DYNAMIC_DISPATCH(FindTileBoxes)(rows, column, boxes);
}

}  // namespace ist
#endif
