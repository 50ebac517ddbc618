// Surveys a patch of an image with vectors of at least four floats. Compiled once per instruction
// set: to be included again for each.
#if defined(IST_PROXIMITY_PATCH_SURVEY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_PATCH_SURVEY_INL_H
#undef IST_PROXIMITY_PATCH_SURVEY_INL_H
#else
#define IST_PROXIMITY_PATCH_SURVEY_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "cloud/index/image_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);

// A vector of floats holds one or several pixels of four tiles side by side: lane 4 i + k is of
// tile k. So the tiles are apart whatever the vector's width, and blocks of four lanes are loaded
// as they are in the message.
template <class D>
struct Pixels {
  hn::Vec<D> x, y, z;
};

template <class D>
constexpr std::size_t kBlocks = hn::MaxLanes(D()) / 4;  // pixels of a tile in a vector

// Neighbouring pixels, a block each.
template <class D>
HWY_INLINE hn::Vec<D> LoadBlocks(D d, const float* from, std::size_t step) {
  if constexpr (kBlocks<D> == 1) {
    return hn::LoadU(d, from);
  } else if constexpr (kBlocks<D> == 2) {
    const hn::Half<D> half;
    if (step != 4) return hn::Combine(d, hn::LoadU(half, from + step), hn::LoadU(half, from));
  }
  return hn::LoadU(d, from);
}

template <class D>
HWY_INLINE Pixels<D> LoadPixels(D d, const float* from, std::size_t step) {
  const hn::Repartition<std::uint64_t, D> pairs;
  const auto a = LoadBlocks(d, from, step), b = LoadBlocks(d, from + kTileSide * step, step),
             c = LoadBlocks(d, from + 2 * kTileSide * step, step),
             e = LoadBlocks(d, from + 3 * kTileSide * step, step);
  const auto xy_ab = hn::BitCast(pairs, hn::InterleaveLower(d, a, b));
  const auto xy_ce = hn::BitCast(pairs, hn::InterleaveLower(d, c, e));
  const auto zw_ab = hn::BitCast(pairs, hn::InterleaveUpper(d, a, b));
  const auto zw_ce = hn::BitCast(pairs, hn::InterleaveUpper(d, c, e));
  return {hn::BitCast(d, hn::InterleaveLower(pairs, xy_ab, xy_ce)),
          hn::BitCast(d, hn::InterleaveUpper(pairs, xy_ab, xy_ce)),
          hn::BitCast(d, hn::InterleaveLower(pairs, zw_ab, zw_ce))};
}

template <class D>
HWY_INLINE hn::Vec<D> SquaredNorm(const Pixels<D>& p) {
  return hn::MulAdd(p.x, p.x, hn::MulAdd(p.y, p.y, hn::Mul(p.z, p.z)));
}

template <class D>
HWY_INLINE hn::Vec<D> SquaredStep(const Pixels<D>& a, const Pixels<D>& b) {
  return SquaredNorm<D>({hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)});
}

// The least (or greatest) of each tile, in all blocks.
template <class D, class Of>
HWY_INLINE hn::Vec<D> OverBlocks(D d, hn::Vec<D> v, const Of& of) {
  if constexpr (kBlocks<D> == 4) v = of(v, hn::ReverseBlocks(d, v));
  if constexpr (kBlocks<D> >= 2) v = of(v, hn::SwapAdjacentBlocks(v));
  return v;
}

template <class M, class D>
HWY_INLINE std::uint32_t Bits(D d, const M& mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8;
}

// Of four tiles side by side.
template <class D>
class Box {
 public:
  HWY_INLINE Box() {
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
    min = OverBlocks(d, min, [](V a, V b) { return hn::Min(a, b); });
    max = OverBlocks(d, max, [](V a, V b) { return hn::Max(a, b); });
    hn::Store(FirstBlock(min), four, to_min);
    hn::Store(FirstBlock(max), four, to_max);
    return hn::Sub(max, min);
  }

 public:
  static HWY_INLINE auto FirstBlock(V v) {
    if constexpr (kBlocks<D> == 4) {
      return hn::LowerHalf(hn::LowerHalf(v));
    } else if constexpr (kBlocks<D> == 2) {
      return hn::LowerHalf(v);
    } else {
      return v;
    }
  }

 private:
  V min_x_, min_y_, min_z_, max_x_, max_y_, max_z_;
};

// One patch, four tiles after four.
template <class D, bool kWhole>
class Surveyor {
 public:
  HWY_INLINE Surveyor(const PatchPose& pose, const PatchPixels& pixels, Patch* patch)
      : pose_(pose), pixels_(pixels), patch_(*patch) {
    const D d;
    for (int i = 0; i < 9; ++i) R_[i] = hn::Set(d, pose.R[i]);
    for (int i = 0; i < 3; ++i) t_[i] = hn::Set(d, pose.t[i]);
    zeros_ = hn::Zero(d);
  }

  HWY_INLINE PatchState Run() {
    patch_.suspicious = patch_.not_a_number = 0;
    const D d;
    for (std::size_t r = 0; r < kPatchTiles; ++r) {
      TileRow(r);
      if (kWhole && !hn::AllTrue(d, hn::Eq(zeros_, hn::Zero(d)))) return PatchState::kSome;
    }
    if (is_unclear_) return PatchState::kUnclear;
    FindBox();
    Widen();
    if (kWhole && !IsInRange()) return PatchState::kSome;
    if (!kWhole || !IsEven()) FindSuspicious();
    return kWhole ? PatchState::kAll : PatchState::kSome;
  }

 private:
  using V = hn::Vec<D>;
  static constexpr std::size_t kSteps = kTileSide / kBlocks<D>;  // vectors for a row of pixels

  HWY_INLINE void TileRow(std::size_t r) {
    const D d;
    const std::size_t slot = kPatchTiles * r;
    Box<D> box;
    if (!kWhole) std::fill_n(patch_.kept + slot, kPatchTiles, 0U);
    for (std::size_t i = 0; i < kTileSide; ++i) {
      const float* row = pixels_.points + (kTileSide * r + i) * pixels_.stride;
      if (kWhole) PrefetchNext(row);
      for (std::size_t j = 0; j < kSteps; ++j) {
        const Pixels<D> p = LoadPixels(d, row + j * kBlocks<D> * pixels_.step, pixels_.step);
        const Pixels<D> posed = Posed(p);
        if constexpr (kWhole) {
          // All coordinates are in each; zero times what is not finite is NaN.
          zeros_ = hn::MulAdd(posed.x, hn::Zero(d), zeros_);
          box.Extend(posed);
        } else {
          box.Extend(posed, Kept(SquaredNorm(p), slot, kTileSide * i + j * kBlocks<D>));
        }
      }
    }
    const V diagonal_sq = box.Store(slot, &patch_.boxes);
    hn::Store(Box<D>::FirstBlock(diagonal_sq), hn::CappedTag<float, 4>(),
              patch_.diagonal_sq + slot);
  }

  // The next patch's pixels of a row are what is asked for next.
  HWY_INLINE void PrefetchNext(const float* row) const {
    constexpr std::size_t line = 16;  // floats
    for (std::size_t k = 0; k < kPatchSide * pixels_.step; k += line) {
      hwy::Prefetch(row + kPatchSide * pixels_.step + k);
    }
  }

  HWY_INLINE Pixels<D> Posed(const Pixels<D>& p) const {
    return {Posed(0, p), Posed(1, p), Posed(2, p)};
  }
  HWY_INLINE V Posed(int row, const Pixels<D>& p) const {
    const V* r = R_ + 3 * row;
    return hn::MulAdd(r[0], p.x, hn::MulAdd(r[1], p.y, hn::MulAdd(r[2], p.z, t_[row])));
  }

  // @param first  number in its tile of the pixel in the first block
  HWY_INLINE auto Kept(V sq, std::size_t slot, std::size_t first) {
    const D d;
    const auto kept =
        hn::And(hn::Ge(sq, hn::Set(d, pose_.least)), hn::Le(sq, hn::Set(d, pose_.most)));
    const auto nan = hn::Not(hn::Eq(sq, sq));
    const auto out = hn::Or(nan, hn::Or(hn::Lt(sq, hn::Set(d, pose_.none_below)),
                                        hn::Gt(sq, hn::Set(d, pose_.none_above))));
    // Whether infinite is what was measured, or only its square, has to be looked at.
    const auto endless = hn::Eq(sq, hn::Set(d, kInfinity));
    is_unclear_ = is_unclear_ || !hn::AllTrue(d, hn::Or(kept, out)) || !hn::AllFalse(d, endless);
    patch_.not_a_number += static_cast<std::uint32_t>(hn::CountTrue(d, nan));
    const std::uint32_t bits = Bits(d, kept);
    for (std::size_t k = 0; k < kPatchTiles; ++k) {
      const std::uint32_t one = bits >> k & 0x1111U;  // a bit of each block
      patch_.kept[slot + k] |= ((one | one >> 3 | one >> 6 | one >> 9) & 0xFU) << first;
    }
    return kept;
  }

  // BoundingSphere all tiles.
  HWY_INLINE void FindBox() {
    const hn::CappedTag<float, kPointWidth> d;
    const BoxNode& boxes = patch_.boxes;
    const float* const mins[3] = {boxes.min_x, boxes.min_y, boxes.min_z};
    const float* const maxs[3] = {boxes.max_x, boxes.max_y, boxes.max_z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto least = hn::Load(d, mins[axis]), most = hn::Load(d, maxs[axis]);
      for (std::size_t k = hn::Lanes(d); k < kSlots; k += hn::Lanes(d)) {
        least = hn::Min(least, hn::Load(d, mins[axis] + k));
        most = hn::Max(most, hn::Load(d, maxs[axis] + k));
      }
      patch_.min[axis] = hn::GetLane(hn::MinOfLanes(d, least));
      patch_.max[axis] = hn::GetLane(hn::MaxOfLanes(d, most));
    }
    auto sum = hn::Zero(d);
    for (std::size_t k = 0; k < kSlots; k += hn::Lanes(d)) {
      sum = hn::Add(sum, hn::Sqrt(hn::Load(d, patch_.diagonal_sq + k)));
    }
    patch_.diagonals = hn::GetLane(hn::SumOfLanes(d, sum));
  }

  // Whether all that the box may hold is in range.
  HWY_INLINE bool IsInRange() const {
    float least_sq = 0.0F, most_sq = 0.0F;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float below = patch_.min[axis] - pose_.t[axis],
                  above = pose_.t[axis] - patch_.max[axis];
      const float nearest = std::max({below, above, 0.0F}), farthest = std::max(-below, -above);
      least_sq += nearest * nearest;
      most_sq += farthest * farthest;
    }
    return least_sq >= pose_.least && most_sq <= pose_.most;
  }

  // No tile is much longer than others, and each as long as its share of the patch, which is a
  // quarter on a plane: none spans an edge that the others do not, nor do all of them.
  HWY_INLINE bool IsEven() const {
    const hn::CappedTag<float, kPointWidth> d;
    auto longest_sq = hn::Load(d, patch_.diagonal_sq);
    for (std::size_t k = hn::Lanes(d); k < kSlots; k += hn::Lanes(d)) {
      longest_sq = hn::Max(longest_sq, hn::Load(d, patch_.diagonal_sq + k));
    }
    const float longest = std::sqrt(hn::GetLane(hn::MaxOfLanes(d, longest_sq)));
    float around_sq = 0.0F;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float size = patch_.max[axis] - patch_.min[axis];
      around_sq += size * size;
    }
    constexpr float kMuch = 2.0F, kShare = 3.0F;
    return longest * static_cast<float>(kSlots) <= kMuch * patch_.diagonals &&
           std::sqrt(around_sq) * static_cast<float>(kSlots) >= kShare * patch_.diagonals;
  }

  // Steps from pixel to pixel, each the shorter one of those at opposite corners of a tile, say how
  // long it would be on a plane.
  void FindSuspicious() {
    const hn::CappedTag<float, 4> d;
    for (std::size_t slot = 0; slot < kSlots; slot += kPatchTiles) {
      const float* first = pixels_.points + tile_row(slot) * pixels_.stride;
      const auto at = [&](std::size_t row, std::size_t column) {
        return LoadPixels(d, first + row * pixels_.stride + column * pixels_.step, pixels_.step);
      };
      const auto top = at(0, 0), bottom = at(3, 3);
      const auto across = hn::Min(SquaredStep(top, at(0, 1)), SquaredStep(bottom, at(3, 2)));
      const auto down = hn::Min(SquaredStep(top, at(1, 0)), SquaredStep(bottom, at(2, 3)));
      const auto longest = hn::Mul(hn::Set(d, kLongestTile), hn::Add(across, down));
      const auto diagonal_sq = hn::Load(d, patch_.diagonal_sq + slot);
      patch_.suspicious |= Bits(d, hn::Gt(diagonal_sq, longest)) << slot;
    }
  }

  // By what float may be off.
  HWY_INLINE void Widen() {
    if (!(patch_.min[0] <= patch_.max[0])) return;  // nothing is kept
    const hn::CappedTag<float, kPointWidth> d;
    float most = 0.0F;  // no coordinate is larger
    for (std::size_t axis = 0; axis < 3; ++axis) {
      most = std::max({most, -patch_.min[axis], patch_.max[axis]});
    }
    const float by = kBoxError * (2.0F * most + 2.0F * pose_.translation);
    BoxNode& boxes = patch_.boxes;
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
    for (float& min : patch_.min) min -= by;
    for (float& max : patch_.max) max += by;
  }

  const PatchPose& pose_;
  const PatchPixels pixels_;
  Patch& patch_;
  V R_[9], t_[3];
  V zeros_;  // NaN where something is not finite
  bool is_unclear_ = false;
};

// Nothing was measured, if all pixels have the same coordinate NaN.
template <class D>
HWY_INLINE bool IsBlind(const PatchPixels& pixels) {
  const D d;
  const float* row = pixels.points;
  auto nan = hn::Eq(hn::Zero(d), hn::Zero(d));
  for (std::size_t i = 0; i < kPatchSide; ++i, row += pixels.stride) {
    for (std::size_t k = 0; k < kPatchSide; k += kBlocks<D>) {
      const auto p = LoadBlocks(d, row + k * pixels.step, pixels.step);
      nan = hn::And(nan, hn::Not(hn::Eq(p, p)));
    }
    if (hn::AllFalse(d, nan)) return false;
  }
  std::uint32_t bits = Bits(d, nan);
  if (kBlocks<D> == 4) bits &= bits >> 8;
  if (kBlocks<D> >= 2) bits &= bits >> 4;
  return (bits & 7U) != 0;
}

template <class D>
HWY_INLINE PatchState SurveyAs(const PatchPose& pose, const PatchPixels& pixels, Patch* patch) {
  if (pixels.points[2] != pixels.points[2] && IsBlind<D>(pixels)) return PatchState::kNone;
  const PatchState state = Surveyor<D, true>(pose, pixels, patch).Run();
  if (state != PatchState::kSome) return state;
  return Surveyor<D, false>(pose, pixels, patch).Run();
}

PatchState SurveyPatch(const PatchPose& pose, const PatchPixels& pixels, Patch* patch) {
  if (pixels.step == 4) return SurveyAs<hn::CappedTag<float, 16>>(pose, pixels, patch);
  return SurveyAs<hn::CappedTag<float, 8>>(pose, pixels, patch);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_PATCH_SURVEY_INL_H
