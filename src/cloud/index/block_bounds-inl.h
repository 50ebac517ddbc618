// Bounds of a block of an organized cloud. Compiled once per instruction set: to be included again
// for each.
#if defined(IST_PROXIMITY_BLOCK_BOUNDS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_BLOCK_BOUNDS_INL_H
#undef IST_PROXIMITY_BLOCK_BOUNDS_INL_H
#else
#define IST_PROXIMITY_BLOCK_BOUNDS_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "cloud/index/block_bounds.h"
#include "cloud/index/split_rule.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace block_bounds {
namespace hn = hwy::HWY_NAMESPACE;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);

// A vector of floats holds one or several pixels of each of four tiles side by side: lane 4 i + k
// belongs to tile k. So tiles do not mix whatever the vector's width, and the four floats of a
// pixel are loaded as they are in the message. Where a vector has one lane only, it holds one pixel
// of one tile.
template <class D>
constexpr std::size_t kTiles = hn::MaxLanes(D()) < 4 ? 1 : 4;  // tiles in a vector
template <class D>
constexpr std::size_t kPixels = hn::MaxLanes(D()) / kTiles<D>;  // pixels of a tile in a vector

template <class D>
struct Pixels {
  hn::Vec<D> x, y, z;
};

#if HWY_TARGET == HWY_SCALAR  // one lane; Highway has no operations between lanes there

template <class D>
HWY_INLINE hn::Vec<D> LoadAsStored(D d, const float* from, std::size_t /*step*/) {
  return hn::LoadU(d, from);
}

template <class D>
HWY_INLINE Pixels<D> LoadPixels(D d, const float* from, std::size_t /*step*/) {
  return {hn::LoadU(d, from), hn::LoadU(d, from + 1), hn::LoadU(d, from + 2)};
}

#else

// The coordinates of neighbouring pixels as they are in the message, four lanes each.
template <class D>
HWY_INLINE hn::Vec<D> LoadAsStored(D d, const float* from, std::size_t step) {
  if constexpr (kPixels<D> == 2) {
    const hn::Half<D> half;
    if (step != 4) return hn::Combine(d, hn::LoadU(half, from + step), hn::LoadU(half, from));
  }
  return hn::LoadU(d, from);
}

// The same pixels of tiles side by side.
// @param from  the first tile's
template <class D>
HWY_INLINE Pixels<D> LoadPixels(D d, const float* from, std::size_t step) {
  const hn::Repartition<std::uint64_t, D> pairs;
  const auto a = LoadAsStored(d, from, step), b = LoadAsStored(d, from + kTileSide * step, step),
             c = LoadAsStored(d, from + 2 * kTileSide * step, step),
             e = LoadAsStored(d, from + 3 * kTileSide * step, step);
  const auto xy_ab = hn::BitCast(pairs, hn::InterleaveLower(d, a, b));
  const auto xy_ce = hn::BitCast(pairs, hn::InterleaveLower(d, c, e));
  const auto zw_ab = hn::BitCast(pairs, hn::InterleaveUpper(d, a, b));
  const auto zw_ce = hn::BitCast(pairs, hn::InterleaveUpper(d, c, e));
  return {hn::BitCast(d, hn::InterleaveLower(pairs, xy_ab, xy_ce)),
          hn::BitCast(d, hn::InterleaveUpper(pairs, xy_ab, xy_ce)),
          hn::BitCast(d, hn::InterleaveLower(pairs, zw_ab, zw_ce))};
}

#endif

template <class D>
HWY_INLINE hn::Vec<D> SquaredNorm(const Pixels<D>& p) {
  return hn::MulAdd(p.x, p.x, hn::MulAdd(p.y, p.y, hn::Mul(p.z, p.z)));
}

template <class D>
HWY_INLINE hn::Vec<D> SquaredStep(const Pixels<D>& a, const Pixels<D>& b) {
  return SquaredNorm<D>({hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)});
}

// The least (or greatest) number of each tile, in all of its lanes.
template <class D, class Reduce>
HWY_INLINE hn::Vec<D> OverPixels(D d, hn::Vec<D> v, const Reduce& reduce) {
  if constexpr (kPixels<D> == 4) v = reduce(v, hn::ReverseBlocks(d, v));
  if constexpr (kPixels<D> >= 2) v = reduce(v, hn::SwapAdjacentBlocks(v));
  return v;
}

template <class M, class D>
HWY_INLINE std::uint32_t Bits(D d, const M& mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8;
}

// The boxes of tiles side by side.
template <class D>
class Boxes {
 public:
  HWY_INLINE Boxes() {
    for (auto* min : {&min_x_, &min_y_, &min_z_}) *min = hn::Set(D(), kInfinity);
    for (auto* max : {&max_x_, &max_y_, &max_z_}) *max = hn::Set(D(), -kInfinity);
  }
  HWY_INLINE void Extend(const Pixels<D>& p) {
    Extend(p.x, p.x, &min_x_, &max_x_);
    Extend(p.y, p.y, &min_y_, &max_y_);
    Extend(p.z, p.z, &min_z_, &max_z_);
  }
  template <class M>
  HWY_INLINE void Extend(const Pixels<D>& p, const M& kept) {
    const D d;
    const auto high = hn::Set(d, kInfinity), low = hn::Set(d, -kInfinity);
    Extend(hn::IfThenElse(kept, p.x, high), hn::IfThenElse(kept, p.x, low), &min_x_, &max_x_);
    Extend(hn::IfThenElse(kept, p.y, high), hn::IfThenElse(kept, p.y, low), &min_y_, &max_y_);
    Extend(hn::IfThenElse(kept, p.z, high), hn::IfThenElse(kept, p.z, low), &min_z_, &max_z_);
  }
  // @returns the squared diagonals
  HWY_INLINE hn::Vec<D> Store(std::size_t slot, BoxNode* to) const {
    return SquaredNorm<D>({Store(min_x_, max_x_, to->min_x + slot, to->max_x + slot),
                           Store(min_y_, max_y_, to->min_y + slot, to->max_y + slot),
                           Store(min_z_, max_z_, to->min_z + slot, to->max_z + slot)});
  }

 private:
  using V = hn::Vec<D>;
  static HWY_INLINE void Extend(V low, V high, V* min, V* max) {
    *min = hn::Min(*min, low);
    *max = hn::Max(*max, high);
  }
  static HWY_INLINE V Store(V min, V max, float* to_min, float* to_max) {
    const D d;
    const hn::CappedTag<float, 4> four;
    min = OverPixels(d, min, [](V a, V b) { return hn::Min(a, b); });
    max = OverPixels(d, max, [](V a, V b) { return hn::Max(a, b); });
    hn::Store(FirstPixel(min), four, to_min);
    hn::Store(FirstPixel(max), four, to_max);
    return hn::Sub(max, min);
  }

 public:
  // One lane of each tile.
  static HWY_INLINE auto FirstPixel(V v) {
    if constexpr (kPixels<D> == 4) {
      return hn::LowerHalf(hn::LowerHalf(v));
    } else if constexpr (kPixels<D> == 2) {
      return hn::LowerHalf(v);
    } else {
      return v;
    }
  }

 private:
  V min_x_, min_y_, min_z_, max_x_, max_y_, max_z_;
};

// The work on one block.
// @tparam kWhole  all pixels are taken for kept; Run() returns kSome where they are not
template <class D, bool kWhole>
class BlockBounder {
 public:
  HWY_INLINE BlockBounder(const BlockTransform& transform, const BlockPixels& pixels,
                          BlockBounds* block)
      : transform_(transform), pixels_(pixels), block_(*block) {
    const D d;
    for (int i = 0; i < 9; ++i) R_[i] = hn::Set(d, transform.R[i]);
    for (int i = 0; i < 3; ++i) t_[i] = hn::Set(d, transform.t[i]);
    zeros_ = hn::Zero(d);
  }

  HWY_INLINE BlockState Run() {
    block_.may_have_edge = block_.not_a_number = block_.too_near = block_.not_believed = 0;
    const D d;
    for (std::size_t r = 0; r < kBlockTiles; ++r) {
      BoundTileRow(r);
      if (kWhole && !hn::AllTrue(d, hn::Eq(zeros_, hn::Zero(d)))) return BlockState::kSome;
    }
    if (is_unclear_) return BlockState::kUnclear;
    FindBox();
    Widen();
    if (kWhole && !IsInRange()) return BlockState::kSome;
    if (!kWhole || !IsEven()) FindEdges();
    return kWhole ? BlockState::kAll : BlockState::kSome;
  }

 private:
  using V = hn::Vec<D>;
  static constexpr std::size_t kSteps =
      kTileSide / kPixels<D>;  // vectors for a row of a tile's pixels

  HWY_INLINE void BoundTileRow(std::size_t r) {
    for (std::size_t c = 0; c < kBlockTiles; c += kTiles<D>) BoundTiles(kBlockTiles * r + c);
  }

  // @param slot  of the first tile in a vector
  HWY_INLINE void BoundTiles(std::size_t slot) {
    const D d;
    Boxes<D> boxes;
    if (!kWhole) std::fill_n(block_.kept + slot, kTiles<D>, 0U);
    for (std::size_t i = 0; i < kTileSide; ++i) {
      const float* row = pixels_.points + (tile_row(slot) + i) * pixels_.stride;
      if (kWhole && tile_column(slot) == 0) PrefetchNext(row);
      row += tile_column(slot) * pixels_.step;
      for (std::size_t j = 0; j < kSteps; ++j) {
        const Pixels<D> p = LoadPixels(d, row + j * kPixels<D> * pixels_.step, pixels_.step);
        const Pixels<D> moved = Moved(p);
        if constexpr (kWhole) {
          // All coordinates are in each; zero times what is not finite is NaN.
          zeros_ = hn::MulAdd(moved.x, hn::Zero(d), zeros_);
          boxes.Extend(moved);
        } else {
          boxes.Extend(moved, Kept(SquaredNorm(p), slot, kTileSide * i + j * kPixels<D>));
        }
      }
    }
    const V diagonal_sq = boxes.Store(slot, &block_.boxes);
    hn::Store(Boxes<D>::FirstPixel(diagonal_sq), hn::CappedTag<float, 4>(),
              block_.diagonal_sq + slot);
  }

  // The same row of the next block will be read next.
  HWY_INLINE void PrefetchNext(const float* row) const {
    constexpr std::size_t line = 16;  // floats
    for (std::size_t k = 0; k < kBlockSide * pixels_.step; k += line) {
      hwy::Prefetch(row + kBlockSide * pixels_.step + k);
    }
  }

  HWY_INLINE Pixels<D> Moved(const Pixels<D>& p) const {
    return {Moved(0, p), Moved(1, p), Moved(2, p)};
  }
  HWY_INLINE V Moved(int row, const Pixels<D>& p) const {
    const V* r = R_ + 3 * row;
    return hn::MulAdd(r[0], p.x, hn::MulAdd(r[1], p.y, hn::MulAdd(r[2], p.z, t_[row])));
  }

  // @param first  number, within its tile, of the first pixel in the vector
  HWY_INLINE auto Kept(V sq, std::size_t slot, std::size_t first) {
    const D d;
    const auto kept = hn::And(hn::Ge(sq, hn::Set(d, transform_.keep_from)),
                              hn::Le(sq, hn::Set(d, transform_.keep_to)));
    const auto nan = hn::Not(hn::Eq(sq, sq));
    const auto near = hn::Lt(sq, hn::Set(d, transform_.drop_below));
    const auto out_of_range = hn::Or(near, hn::Gt(sq, hn::Set(d, transform_.drop_above)));
    const auto out = hn::Or(nan, out_of_range);
    // Infinite coordinates and finite ones with an infinite square are told apart in double.
    const auto infinite = hn::Eq(sq, hn::Set(d, kInfinity));
    is_unclear_ = is_unclear_ || !hn::AllTrue(d, hn::Or(kept, out)) || !hn::AllFalse(d, infinite);
    block_.not_a_number += static_cast<std::uint32_t>(hn::CountTrue(d, nan));
    if (!hn::AllFalse(d, out_of_range)) {
      block_.too_near += static_cast<std::uint32_t>(hn::CountTrue(d, near));
      block_.not_believed +=
          static_cast<std::uint32_t>(hn::CountTrue(d, hn::Gt(sq, hn::Set(d, transform_.believed))));
    }
    const std::uint32_t bits = Bits(d, kept);
    for (std::size_t k = 0; k < kTiles<D>; ++k) {
      const std::uint32_t one = bits >> k & 0x1111U;  // a bit of each pixel
      block_.kept[slot + k] |= ((one | one >> 3 | one >> 6 | one >> 9) & 0xFU) << first;
    }
    return kept;
  }

  // The box of all tiles, and the sum of their diagonals.
  HWY_INLINE void FindBox() {
    const hn::CappedTag<float, kPointWidth> d;
    const BoxNode& boxes = block_.boxes;
    const float* const mins[3] = {boxes.min_x, boxes.min_y, boxes.min_z};
    const float* const maxs[3] = {boxes.max_x, boxes.max_y, boxes.max_z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto least = hn::Load(d, mins[axis]), most = hn::Load(d, maxs[axis]);
      for (std::size_t k = hn::Lanes(d); k < kSlots; k += hn::Lanes(d)) {
        least = hn::Min(least, hn::Load(d, mins[axis] + k));
        most = hn::Max(most, hn::Load(d, maxs[axis] + k));
      }
      block_.min[axis] = hn::GetLane(hn::MinOfLanes(d, least));
      block_.max[axis] = hn::GetLane(hn::MaxOfLanes(d, most));
    }
    auto sum = hn::Zero(d);
    for (std::size_t k = 0; k < kSlots; k += hn::Lanes(d)) {
      sum = hn::Add(sum, hn::Sqrt(hn::Load(d, block_.diagonal_sq + k)));
    }
    block_.diagonals = hn::GetLane(hn::SumOfLanes(d, sum));
  }

  // Whether every point of the box is in range.
  HWY_INLINE bool IsInRange() const {
    float least_sq = 0.0F, most_sq = 0.0F;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float below = block_.min[axis] - transform_.t[axis],
                  above = transform_.t[axis] - block_.max[axis];
      const float nearest = std::max({below, above, 0.0F}), farthest = std::max(-below, -above);
      least_sq += nearest * nearest;
      most_sq += farthest * farthest;
    }
    return least_sq >= transform_.keep_from && most_sq <= transform_.keep_to;
  }

  // Whether no tile is much longer than the mean, and the block as much longer than its tiles as on
  // a surface: then no single tile spans a depth discontinuity, nor do all of them.
  HWY_INLINE bool IsEven() const {
    const hn::CappedTag<float, kPointWidth> d;
    auto longest_sq = hn::Load(d, block_.diagonal_sq);
    for (std::size_t k = hn::Lanes(d); k < kSlots; k += hn::Lanes(d)) {
      longest_sq = hn::Max(longest_sq, hn::Load(d, block_.diagonal_sq + k));
    }
    const float longest = std::sqrt(hn::GetLane(hn::MaxOfLanes(d, longest_sq)));
    float whole_sq = 0.0F;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float size = block_.max[axis] - block_.min[axis];
      whole_sq += size * size;
    }
    return longest * static_cast<float>(kSlots) <= kLongestOfMean * block_.diagonals &&
           std::sqrt(whole_sq) * static_cast<float>(kSlots) >= kBlockOfMean * block_.diagonals;
  }

  // The steps from pixel to pixel along both sides of a tile, each the shorter one of those at
  // opposite corners, give the length that the tile would have on a plane.
  void FindEdges() {
    const hn::CappedTag<float, 4> d;
    for (std::size_t slot = 0; slot < kSlots; slot += kTiles<decltype(d)>) {
      const float* first =
          pixels_.points + tile_row(slot) * pixels_.stride + tile_column(slot) * pixels_.step;
      const auto at = [&](std::size_t row, std::size_t column) {
        return LoadPixels(d, first + row * pixels_.stride + column * pixels_.step, pixels_.step);
      };
      const auto top = at(0, 0), bottom = at(3, 3);
      const auto across = hn::Min(SquaredStep(top, at(0, 1)), SquaredStep(bottom, at(3, 2)));
      const auto down = hn::Min(SquaredStep(top, at(1, 0)), SquaredStep(bottom, at(2, 3)));
      const auto longest = hn::Mul(hn::Set(d, kLongestTileSq), hn::Add(across, down));
      const auto diagonal_sq = hn::Load(d, block_.diagonal_sq + slot);
      block_.may_have_edge |= Bits(d, hn::Gt(diagonal_sq, longest)) << slot;
    }
  }

  // Widens all boxes by the rounding of float.
  HWY_INLINE void Widen() {
    if (!(block_.min[0] <= block_.max[0])) return;  // nothing is kept
    const hn::CappedTag<float, kPointWidth> d;
    float most = 0.0F;  // no coordinate is larger
    for (std::size_t axis = 0; axis < 3; ++axis) {
      most = std::max({most, -block_.min[axis], block_.max[axis]});
    }
    const float by = kBoxError * (2.0F * most + 2.0F * transform_.translation);
    BoxNode& boxes = block_.boxes;
    for (float* min : {boxes.min_x, boxes.min_y, boxes.min_z}) {
      for (std::size_t k = 0; k < kSlots; k += hn::Lanes(d)) {
        hn::Store(hn::Sub(hn::Load(d, min + k), hn::Set(d, by)), d, min + k);
      }
    }
    for (float* max : {boxes.max_x, boxes.max_y, boxes.max_z}) {
      for (std::size_t k = 0; k < kSlots; k += hn::Lanes(d)) {
        hn::Store(hn::Add(hn::Load(d, max + k), hn::Set(d, by)), d, max + k);
      }
    }
    for (float& min : block_.min) min -= by;
    for (float& max : block_.max) max += by;
  }

  const BlockTransform& transform_;
  const BlockPixels pixels_;
  BlockBounds& block_;
  V R_[9], t_[3];
  V zeros_;                  // NaN where something is not finite
  bool is_unclear_ = false;  // float cannot decide which pixels are kept
};

// Whether nothing was measured: the same coordinate of all pixels is NaN. Vectors of one lane look
// at z alone.
template <class D>
HWY_INLINE bool IsBlind(const BlockPixels& pixels) {
  const D d;
  const float* row = pixels.points + (kTiles<D> == 1 ? 2 : 0);
  auto nan = hn::Eq(hn::Zero(d), hn::Zero(d));
  for (std::size_t i = 0; i < kBlockSide; ++i, row += pixels.stride) {
    for (std::size_t k = 0; k < kBlockSide; k += kPixels<D>) {
      const auto p = LoadAsStored(d, row + k * pixels.step, pixels.step);
      nan = hn::And(nan, hn::Not(hn::Eq(p, p)));
    }
    if (hn::AllFalse(d, nan)) return false;
  }
  std::uint32_t bits = Bits(d, nan);
  if (kPixels<D> == 4) bits &= bits >> 8;
  if (kPixels<D> >= 2) bits &= bits >> 4;
  return (bits & (kTiles<D> == 1 ? 1U : 7U)) != 0;
}

template <class D>
HWY_INLINE BlockState BoundBlockAs(const BlockTransform& transform, const BlockPixels& pixels,
                                   BlockBounds* block) {
  if (pixels.points[2] != pixels.points[2] && IsBlind<D>(pixels)) return BlockState::kNone;
  const BlockState state = BlockBounder<D, true>(transform, pixels, block).Run();
  if (state != BlockState::kSome) return state;
  return BlockBounder<D, false>(transform, pixels, block).Run();
}

BlockState BoundBlock(const BlockTransform& transform, const BlockPixels& pixels,
                      BlockBounds* block) {
  if (pixels.step == 4) return BoundBlockAs<hn::CappedTag<float, 16>>(transform, pixels, block);
  return BoundBlockAs<hn::CappedTag<float, 8>>(transform, pixels, block);
}

}  // namespace block_bounds

using block_bounds::BoundBlock;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_BLOCK_BOUNDS_INL_H
