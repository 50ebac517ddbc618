// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/image_kernel.cpp"
#include "cloud/image_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using PixelTag = hn::CappedTag<float, kPatchSide>;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

#if HWY_TARGET != HWY_SCALAR

// The pixels of one row of an image, as many as a vector holds.
struct Pixels {
  hn::Vec<PixelTag> x, y, z;
};

HWY_INLINE Pixels LoadPixels(const CropBlock& block, std::size_t slot) {
  const PixelTag d;
  return {hn::Load(d, block.x + slot), hn::Load(d, block.y + slot), hn::Load(d, block.z + slot)};
}

// The least (or greatest) of each four neighbours, in all four of their places.
template <class V, class Of>
HWY_INLINE V OfFour(V v, const Of& of) {
  v = of(v, hn::Shuffle2301(v));
  return of(v, hn::Shuffle1032(v));
}

HWY_INLINE hn::Vec<PixelTag> SquaredStep(const Pixels& a, const Pixels& b) {
  const auto x = hn::Sub(a.x, b.x), y = hn::Sub(a.y, b.y), z = hn::Sub(a.z, b.z);
  return hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
}

HWY_INLINE hn::Vec<PixelTag> SquaredStepAcross(const Pixels& a) {
  return SquaredStep(a, {hn::Shuffle2301(a.x), hn::Shuffle2301(a.y), hn::Shuffle2301(a.z)});
}

// Some tiles side by side.
class Box {
 public:
  HWY_INLINE Box() {
    min_x_ = min_y_ = min_z_ = hn::Set(PixelTag(), kInfinity);
    max_x_ = max_y_ = max_z_ = hn::Set(PixelTag(), -kInfinity);
  }
  HWY_INLINE void Extend(const Pixels& p) {
    Extend(p.x, p.x, &min_x_, &max_x_);
    Extend(p.y, p.y, &min_y_, &max_y_);
    Extend(p.z, p.z, &min_z_, &max_z_);
  }
  template <class M>
  HWY_INLINE void Extend(const Pixels& p, const M& kept) {
    const PixelTag d;
    const auto high = hn::Set(d, kInfinity), low = hn::Set(d, -kInfinity);
    Extend(hn::IfThenElse(kept, p.x, high), hn::IfThenElse(kept, p.x, low), &min_x_, &max_x_);
    Extend(hn::IfThenElse(kept, p.y, high), hn::IfThenElse(kept, p.y, low), &min_y_, &max_y_);
    Extend(hn::IfThenElse(kept, p.z, high), hn::IfThenElse(kept, p.z, low), &min_z_, &max_z_);
  }

  // To the places that `which` says, of each four. @returns the squared diagonal
  template <class M>
  HWY_INLINE hn::Vec<PixelTag> Store(const M& which, std::size_t slot, BoxNode* to) const {
    const auto x = Store(which, min_x_, max_x_, to->min_x + slot, to->max_x + slot);
    const auto y = Store(which, min_y_, max_y_, to->min_y + slot, to->max_y + slot);
    const auto z = Store(which, min_z_, max_z_, to->min_z + slot, to->max_z + slot);
    return hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
  }

 private:
  using V = hn::Vec<PixelTag>;

  static HWY_INLINE void Extend(V low, V high, V* min, V* max) {
    *min = hn::Min(*min, low);
    *max = hn::Max(*max, high);
  }
  template <class M>
  static HWY_INLINE V Store(const M& which, V min, V max, float* to_min, float* to_max) {
    const PixelTag d;
    min = OfFour(min, [](V a, V b) { return hn::Min(a, b); });
    max = OfFour(max, [](V a, V b) { return hn::Max(a, b); });
    hn::Store(hn::IfThenElse(which, min, hn::Load(d, to_min)), d, to_min);
    hn::Store(hn::IfThenElse(which, max, hn::Load(d, to_max)), d, to_max);
    return hn::Sub(max, min);
  }

  V min_x_, min_y_, min_z_, max_x_, max_y_, max_z_;
};

template <class M>
HWY_INLINE std::uint32_t Bits(const M& mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(PixelTag(), mask, bits);
  return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8;
}

void FindTiles(const CropBlock& block, PatchTiles* tiles) {
  const PixelTag d;
  const hn::RebindToSigned<PixelTag> di;
  const auto place = hn::And(hn::Iota(di, 0), hn::Set(di, 3));
  tiles->suspicious = 0;
  for (std::uint32_t& kept : tiles->kept) kept = 0;
  for (std::size_t r = 0; r < kPatchTiles; ++r) {
    const auto which = hn::RebindMask(d, hn::Eq(place, hn::Set(di, static_cast<int>(r))));
    std::uint32_t* bits = tiles->kept + kTileSide * r;
    for (std::size_t k = 0; k < kPatchSide; k += hn::Lanes(d)) {
      const std::size_t slot = kTileSide * kPatchSide * r + k;
      const Pixels p[4] = {LoadPixels(block, slot), LoadPixels(block, slot + kPatchSide),
                           LoadPixels(block, slot + 2 * kPatchSide),
                           LoadPixels(block, slot + 3 * kPatchSide)};
      const auto sum = hn::Add(hn::Add(p[0].x, p[1].x), hn::Add(p[2].x, p[3].x));
      Box box;
      if (hn::AllTrue(d, hn::Eq(sum, sum))) {
        const std::uint32_t all = ((1U << hn::Lanes(d)) - 1U) << k;
        for (std::size_t i = 0; i < kTileSide; ++i) {
          box.Extend(p[i]);
          bits[i] |= all;
        }
      } else {
        for (std::size_t i = 0; i < kTileSide; ++i) {
          const auto kept = hn::Eq(p[i].x, p[i].x);
          box.Extend(p[i], kept);
          bits[i] |= Bits(kept) << k;
        }
      }
      const auto diagonal_sq = box.Store(which, k, &tiles->boxes);
      float* to = tiles->diagonal_sq + k;
      hn::Store(hn::IfThenElse(which, diagonal_sq, hn::Load(d, to)), d, to);
      // Steps at opposite corners: in the first of each four places, and in the last, reversed.
      const auto across =
          hn::Min(SquaredStepAcross(p[0]), hn::Shuffle0123(SquaredStepAcross(p[3])));
      const auto down = hn::Min(SquaredStep(p[0], p[1]), hn::Shuffle0123(SquaredStep(p[2], p[3])));
      const auto longest = hn::Mul(hn::Set(d, kLongestTile), hn::Add(across, down));
      const std::uint32_t first_of_four = Bits(hn::Gt(diagonal_sq, longest)) & 0x1111U;
      tiles->suspicious |= first_of_four << (k + r);
    }
  }
}

#else  // one at a time

void FindTiles(const CropBlock& block, PatchTiles* tiles) {
  tiles->suspicious = 0;
  for (std::size_t row = 0; row < kPatchSide; ++row) {
    tiles->kept[row] = 0;
    for (std::size_t k = 0; k < kPatchSide; ++k) {
      const float x = block.x[kPatchSide * row + k];
      tiles->kept[row] |= static_cast<std::uint32_t>(x == x) << k;
    }
  }
  for (std::size_t slot = 0; slot < kPatchTiles * kPatchTiles; ++slot) {
    const std::size_t first = kPatchSide * tile_row(slot) + tile_column(slot);
    const auto extent = [&](const float* v, float* to_min, float* to_max) {
      float min = kInfinity, max = -kInfinity;
      for (std::size_t i = 0; i < kTileSide * kTileSide; ++i) {
        const std::size_t at = first + kPatchSide * (i / kTileSide) + i % kTileSide;
        if (block.x[at] != block.x[at]) continue;
        min = std::min(min, v[at]);
        max = std::max(max, v[at]);
      }
      *to_min = min;
      *to_max = max;
      return (max - min) * (max - min);
    };
    BoxNode& boxes = tiles->boxes;
    const float diagonal_sq = extent(block.x, boxes.min_x + slot, boxes.max_x + slot) +
                              extent(block.y, boxes.min_y + slot, boxes.max_y + slot) +
                              extent(block.z, boxes.min_z + slot, boxes.max_z + slot);
    tiles->diagonal_sq[slot] = diagonal_sq;
    const auto step_sq = [&](std::size_t row_a, std::size_t a, std::size_t row_b, std::size_t b) {
      a += first + kPatchSide * row_a;
      b += first + kPatchSide * row_b;
      const float x = block.x[a] - block.x[b], y = block.y[a] - block.y[b],
                  z = block.z[a] - block.z[b];
      return x * x + y * y + z * z;
    };
    const float across = std::min(step_sq(0, 0, 0, 1), step_sq(3, 3, 3, 2));
    const float down = std::min(step_sq(0, 0, 1, 0), step_sq(2, 3, 3, 3));
    const bool suspicious = diagonal_sq > kLongestTile * (across + down);
    tiles->suspicious |= static_cast<std::uint32_t>(suspicious) << slot;
  }
}

#endif

HWY_INLINE void CopyTile(const CropBlock& block, std::size_t slot, std::uint32_t id,
                         std::uint32_t width, PointTile* to) {
  const hn::CappedTag<float, kTileSide> d;
  const hn::CappedTag<std::uint32_t, kTileSide> du;
  for (std::size_t i = 0; i < kTileSide; ++i) {
    const std::size_t row = tile_row(slot) + i, column = tile_column(slot);
    const std::size_t from = kPatchSide * row + column;
    const std::uint32_t first =
        id + static_cast<std::uint32_t>(row) * width + static_cast<std::uint32_t>(column);
    for (std::size_t k = 0; k < kTileSide; k += hn::Lanes(d)) {
      const std::size_t at = kTileSide * i + k;
      hn::Store(hn::Load(d, block.x + from + k), d, to->x + at);
      hn::Store(hn::Load(d, block.y + from + k), d, to->y + at);
      hn::Store(hn::Load(d, block.z + from + k), d, to->z + at);
      hn::Store(hn::Iota(du, first + static_cast<std::uint32_t>(k)), du, to->id + at);
    }
  }
}

// Moves the points to be kept to the front. What a vector writes too much has been read before.
HWY_INLINE void Compress(std::uint32_t kept, PointTile* tile) {
  const PixelTag d;
  const hn::RebindToUnsigned<PixelTag> du;
  std::size_t n = 0;
  for (std::size_t k = 0; k < kPatchSide; k += hn::Lanes(d)) {
    const std::uint8_t bits[8] = {static_cast<std::uint8_t>(kept >> k),
                                  static_cast<std::uint8_t>(kept >> k >> 8)};
    const auto mask = hn::LoadMaskBits(d, bits);
    hn::CompressStore(hn::Load(d, tile->x + k), mask, d, tile->x + n);
    hn::CompressStore(hn::Load(d, tile->y + k), mask, d, tile->y + n);
    hn::CompressStore(hn::Load(d, tile->z + k), mask, d, tile->z + n);
    n += hn::CompressStore(hn::Load(du, tile->id + k), hn::RebindMask(du, mask), du, tile->id + n);
  }
  tile->count = static_cast<std::int32_t>(n);
  for (; n < kPatchSide; ++n) {
    tile->x[n] = tile->y[n] = tile->z[n] = kFarAway;
    tile->id[n] = 0;
  }
}

void WriteTiles(const CropBlock& block, const PatchTiles& tiles, std::uint32_t which,
                std::uint32_t id, std::uint32_t width, PointTile* to) {
  for (std::size_t slot = 0; slot < kPatchTiles * kPatchTiles; ++slot) {
    if ((which >> slot & 1U) == 0) continue;
    CopyTile(block, slot, id, width, to);
    to->count = kPointWidth;
    const std::uint32_t kept = tiles.kept_of(slot);
    if (kept != 0xFFFFU) Compress(kept, to);
    ++to;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindTiles);
HWY_EXPORT(WriteTiles);

void find_tiles(const CropBlock& block, PatchTiles* tiles) {
  HWY_DYNAMIC_DISPATCH(FindTiles)(block, tiles);
}

void write_tiles(const CropBlock& block, const PatchTiles& tiles, std::uint32_t which,
                 std::uint32_t id, std::uint32_t width, PointTile* to) {
  HWY_DYNAMIC_DISPATCH(WriteTiles)(block, tiles, which, id, width, to);
}

}  // namespace ist
#endif
