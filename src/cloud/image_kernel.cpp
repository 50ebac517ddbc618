// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/image_kernel.cpp"
#include "cloud/image_kernel.h"

#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
// A pixel's coordinate is rounded as it is read, turned (three numbers, three products) and moved
// (one number, three sums), the stored point once, the box once: ten times, each by at most 2^-24
// of the range and the translation together.
constexpr float kBoxError = 12.0F / (1 << 24);

#if HWY_TARGET != HWY_SCALAR

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

// What belongs to the tiles' last pixel, to where the first one is.
template <class D>
HWY_INLINE hn::Vec<D> LastToFirst(D d, hn::Vec<D> v) {
  if constexpr (kBlocks<D> == 4) v = hn::ReverseBlocks(d, v);
  if constexpr (kBlocks<D> == 2) v = hn::SwapAdjacentBlocks(v);
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

// Pixels at opposite corners of four tiles, and their neighbours.
template <class D>
class Corners {
 public:
  // @param i  row
  // @param j  of the row's vectors
  HWY_INLINE void Note(std::size_t i, std::size_t j, const Pixels<D>& p) {
    constexpr std::size_t kLast = kTileSide / kBlocks<D> - 1;
    if (i == 0 && j == 0) first_ = p;
    if (i == 0 && j == 1) right_of_first_ = p;
    if (i == 1 && j == 0) below_first_ = p;
    if (i == 2 && j == kLast) above_last_ = p;
    if (i == 3 && j + 1 == kLast) left_of_last_ = p;
    if (i == 3 && j == kLast) last_ = p;
  }
  // Along a row and along a column of pixels, each the shorter one of those at both corners;
  // squared, in the first block.
  HWY_INLINE hn::Vec<D> Steps() const {
    const D d;
    const auto across =
        hn::Min(Across(first_, right_of_first_), LastToFirst(d, Across(last_, left_of_last_)));
    const auto down =
        hn::Min(SquaredStep(first_, below_first_), LastToFirst(d, SquaredStep(last_, above_last_)));
    return hn::Add(across, down);
  }

 private:
  // Between neighbours in a row: vectors of one block, or blocks of one vector.
  static HWY_INLINE hn::Vec<D> Across(const Pixels<D>& p, const Pixels<D>& neighbour) {
    if constexpr (kBlocks<D> == 1) {
      return SquaredStep(p, neighbour);
    } else {
      return SquaredStep(p, {hn::SwapAdjacentBlocks(p.x), hn::SwapAdjacentBlocks(p.y),
                             hn::SwapAdjacentBlocks(p.z)});
    }
  }

  Pixels<D> first_, right_of_first_, below_first_, above_last_, left_of_last_, last_;
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
    const hn::RebindToUnsigned<D> du;
    least_ = hn::Set(du, ~0U);
    most_ = hn::Zero(du);
    greatest_sq_ = hn::Zero(d);
  }

  HWY_INLINE PatchState Run() {
    patch_.suspicious = patch_.not_a_number = 0;
    const D d;
    const hn::RebindToUnsigned<D> du;
    for (std::size_t r = 0; r < kPatchTiles; ++r) {
      TileRow(r);
      if (!kWhole) continue;
      // Squares are not negative: as bits they compare like numbers, NaN is above all others.
      const auto is_out = hn::Or(hn::Lt(least_, hn::Set(du, Bits32(pose_.least))),
                                 hn::Gt(most_, hn::Set(du, Bits32(pose_.most))));
      if (!hn::AllFalse(du, is_out)) return PatchState::kSome;
    }
    if constexpr (kWhole) {
      Widen(FromBits(hn::GetLane(hn::MaxOfLanes(du, most_))));
      return PatchState::kAll;
    } else {
      if (is_unclear_) return PatchState::kUnclear;
      Widen(hn::GetLane(hn::MaxOfLanes(d, greatest_sq_)));
      return PatchState::kSome;
    }
  }

 private:
  using V = hn::Vec<D>;
  static constexpr std::size_t kSteps = kTileSide / kBlocks<D>;  // vectors for a row of pixels

  static std::uint32_t Bits32(float value) {
    std::uint32_t bits;
    hwy::CopyBytes<4>(&value, &bits);
    return bits;
  }
  static float FromBits(std::uint32_t bits) {
    float value;
    hwy::CopyBytes<4>(&bits, &value);
    return value;
  }

  HWY_INLINE void TileRow(std::size_t r) {
    const D d;
    const std::size_t slot = kPatchTiles * r;
    Corners<D> corners;
    Box<D> box;
    if (!kWhole) std::fill_n(patch_.kept + slot, kPatchTiles, 0U);
    for (std::size_t i = 0; i < kTileSide; ++i) {
      const float* row = pixels_.points + (kTileSide * r + i) * pixels_.stride;
      if (kWhole) PrefetchNext(row);
      for (std::size_t j = 0; j < kSteps; ++j) {
        const Pixels<D> p = LoadPixels(d, row + j * kBlocks<D> * pixels_.step, pixels_.step);
        corners.Note(i, j, p);
        const V sq = SquaredNorm(p);
        if constexpr (kWhole) {
          const hn::RebindToUnsigned<D> du;
          least_ = hn::Min(least_, hn::BitCast(du, sq));
          most_ = hn::Max(most_, hn::BitCast(du, sq));
          box.Extend(Posed(p));
        } else {
          box.Extend(Posed(p), Kept(sq, slot, kTileSide * i + j * kBlocks<D>));
        }
      }
    }
    const V diagonal_sq = box.Store(slot, &patch_.boxes);
    hn::Store(Box<D>::FirstBlock(diagonal_sq), hn::CappedTag<float, 4>(),
              patch_.diagonal_sq + slot);
    const V longest = hn::Mul(hn::Set(d, kLongestTile), corners.Steps());
    patch_.suspicious |= (Bits(d, hn::Gt(diagonal_sq, longest)) & 0xFU) << slot;
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
    greatest_sq_ = hn::Max(greatest_sq_, hn::IfThenElseZero(kept, sq));
    std::uint32_t bits = Bits(d, kept);
    for (std::size_t block = 0; block < kBlocks<D>; ++block, bits >>= 4) {
      for (std::size_t k = 0; k < kPatchTiles; ++k) {
        patch_.kept[slot + k] |= (bits >> k & 1U) << (first + block);
      }
    }
    return kept;
  }

  // Boxes by what float may be off, and the box around all.
  HWY_INLINE void Widen(float greatest_sq) {
    const hn::CappedTag<float, kPointWidth> d;
    const auto by = hn::Set(d, kBoxError * (std::sqrt(greatest_sq) + pose_.translation));
    BoxNode& boxes = patch_.boxes;
    float* const mins[3] = {boxes.min_x, boxes.min_y, boxes.min_z};
    float* const maxs[3] = {boxes.max_x, boxes.max_y, boxes.max_z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto least = hn::Set(d, kInfinity), most = hn::Set(d, -kInfinity);
      for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
        const auto min = hn::Sub(hn::Load(d, mins[axis] + k), by);
        const auto max = hn::Add(hn::Load(d, maxs[axis] + k), by);
        hn::Store(min, d, mins[axis] + k);
        hn::Store(max, d, maxs[axis] + k);
        least = hn::Min(least, min);
        most = hn::Max(most, max);
      }
      patch_.min[axis] = hn::GetLane(hn::MinOfLanes(d, least));
      patch_.max[axis] = hn::GetLane(hn::MaxOfLanes(d, most));
    }
    auto sum = hn::Zero(d);
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      sum = hn::Add(sum, hn::Sqrt(hn::Load(d, patch_.diagonal_sq + k)));
    }
    patch_.diagonals = hn::GetLane(hn::SumOfLanes(d, sum));
  }

  const PatchPose& pose_;
  const PatchPixels pixels_;
  Patch& patch_;
  V R_[9], t_[3];
  hn::Vec<hn::RebindToUnsigned<D>> least_, most_;  // squared ranges, as bits
  V greatest_sq_;
  bool is_unclear_ = false;
};

// Nothing was measured, if all pixels have the same coordinate NaN.
HWY_INLINE bool IsBlind(const PatchPixels& pixels) {
  const hn::CappedTag<float, 4> d;
  const float* row = pixels.points;
  auto nan = hn::Eq(hn::Zero(d), hn::Zero(d));
  for (std::size_t i = 0; i < kPatchSide; ++i, row += pixels.stride) {
    for (std::size_t k = 0; k < kPatchSide; ++k) {
      const auto p = hn::LoadU(d, row + k * pixels.step);
      nan = hn::And(nan, hn::Not(hn::Eq(p, p)));
    }
    if (hn::AllFalse(d, nan)) return false;
  }
  return (Bits(d, nan) & 7U) != 0;
}

template <class D>
HWY_INLINE PatchState SurveyAs(const PatchPose& pose, const PatchPixels& pixels, Patch* patch) {
  if (pixels.points[2] != pixels.points[2] && IsBlind(pixels)) return PatchState::kNone;
  const PatchState state = Surveyor<D, true>(pose, pixels, patch).Run();
  if (state != PatchState::kSome) return state;
  return Surveyor<D, false>(pose, pixels, patch).Run();
}

PatchState SurveyPatch(const PatchPose& pose, const PatchPixels& pixels, Patch* patch) {
  if (pixels.step == 4) return SurveyAs<hn::CappedTag<float, 16>>(pose, pixels, patch);
  return SurveyAs<hn::CappedTag<float, 8>>(pose, pixels, patch);
}

#else  // one at a time

class Tile {
 public:
  Tile(const PatchPose& pose, const PatchPixels& pixels, std::size_t slot)
      : pose_(pose),
        pixels_(pixels),
        first_(pixels.points + tile_row(slot) * pixels.stride + tile_column(slot) * pixels.step) {}

  const float* at(std::size_t row, std::size_t column) const {
    return first_ + row * pixels_.stride + column * pixels_.step;
  }
  static float squared_norm(const float* p) { return p[0] * p[0] + p[1] * p[1] + p[2] * p[2]; }
  float squared_step(std::size_t row_a, std::size_t a, std::size_t row_b, std::size_t b) const {
    const float *p = at(row_a, a), *q = at(row_b, b);
    const float step[3] = {p[0] - q[0], p[1] - q[1], p[2] - q[2]};
    return squared_norm(step);
  }
  float steps_at_corners() const {
    return std::min(squared_step(0, 0, 0, 1), squared_step(3, 3, 3, 2)) +
           std::min(squared_step(0, 0, 1, 0), squared_step(2, 3, 3, 3));
  }
  float posed(int row, const float* p) const {
    const float* r = pose_.R + 3 * row;
    return r[0] * p[0] + (r[1] * p[1] + (r[2] * p[2] + pose_.t[row]));
  }

 private:
  const PatchPose& pose_;
  const PatchPixels& pixels_;
  const float* first_;
};

PatchState SurveyPatch(const PatchPose& pose, const PatchPixels& pixels, Patch* patch) {
  BoxNode& boxes = patch->boxes;
  float* const mins[3] = {boxes.min_x, boxes.min_y, boxes.min_z};
  float* const maxs[3] = {boxes.max_x, boxes.max_y, boxes.max_z};
  patch->suspicious = patch->not_a_number = 0;
  float greatest_sq = 0.0F;
  std::uint32_t kept_by_all = 0xFFFFU;
  for (std::size_t slot = 0; slot < static_cast<std::size_t>(kPointWidth); ++slot) {
    const Tile tile(pose, pixels, slot);
    patch->kept[slot] = 0;
    for (int axis = 0; axis < 3; ++axis) mins[axis][slot] = kInfinity;
    for (int axis = 0; axis < 3; ++axis) maxs[axis][slot] = -kInfinity;
    for (std::size_t i = 0; i < kTileSide * kTileSide; ++i) {
      const float* p = tile.at(i / kTileSide, i % kTileSide);
      const float sq = Tile::squared_norm(p);
      const bool is_kept = sq >= pose.least && sq <= pose.most, is_nan = sq != sq;
      if (!is_kept && !is_nan && !(sq < pose.none_below) && !(sq > pose.none_above)) {
        return PatchState::kUnclear;
      }
      if (sq == kInfinity) return PatchState::kUnclear;
      patch->not_a_number += static_cast<std::uint32_t>(is_nan);
      if (!is_kept) continue;
      patch->kept[slot] |= 1U << i;
      greatest_sq = std::max(greatest_sq, sq);
      for (int axis = 0; axis < 3; ++axis) {
        mins[axis][slot] = std::min(mins[axis][slot], tile.posed(axis, p));
        maxs[axis][slot] = std::max(maxs[axis][slot], tile.posed(axis, p));
      }
    }
    const float diagonal[3] = {maxs[0][slot] - mins[0][slot], maxs[1][slot] - mins[1][slot],
                               maxs[2][slot] - mins[2][slot]};
    patch->diagonal_sq[slot] = Tile::squared_norm(diagonal);
    const bool suspicious = patch->diagonal_sq[slot] > kLongestTile * tile.steps_at_corners();
    patch->suspicious |= static_cast<std::uint32_t>(suspicious) << slot;
    kept_by_all &= patch->kept[slot];
  }
  if (patch->not_a_number == kPatchSide * kPatchSide) return PatchState::kNone;
  const float by = kBoxError * (std::sqrt(greatest_sq) + pose.translation);
  patch->diagonals = 0.0F;
  std::fill_n(patch->min, 3, kInfinity);
  std::fill_n(patch->max, 3, -kInfinity);
  for (std::size_t slot = 0; slot < static_cast<std::size_t>(kPointWidth); ++slot) {
    for (int axis = 0; axis < 3; ++axis) {
      patch->min[axis] = std::min(patch->min[axis], mins[axis][slot] -= by);
      patch->max[axis] = std::max(patch->max[axis], maxs[axis][slot] += by);
    }
    patch->diagonals += std::sqrt(patch->diagonal_sq[slot]);
  }
  return kept_by_all == 0xFFFFU ? PatchState::kAll : PatchState::kSome;
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {
namespace {

// What float makes of a squared range is off by less than this share of it.
constexpr double kSquareError = 1e-6;
// Below, squares are no longer that exact.
constexpr double kSmallestSquare = 1e-30;  // [m^2]

}  // namespace

PatchPose::PatchPose(const CropPose& pose) {
  const Eigen::Matrix3d& rotation = pose.X_OS.linear();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      R[3 * row + column] = static_cast<float>(rotation(row, column));
    }
    t[row] = static_cast<float>(pose.X_OS.translation()[row]);
  }
  translation = static_cast<float>(pose.X_OS.translation().norm() * (1.0 + kSquareError));
  const double min_sq = pose.min_range_sq, max_sq = pose.max_range_sq;
  least = static_cast<float>(min_sq > 0.0 ? std::max((1.0 + kSquareError) * min_sq, kSmallestSquare)
                                          : 0.0);
  none_below = static_cast<float>(min_sq > kSmallestSquare ? (1.0 - kSquareError) * min_sq : 0.0);
  most = static_cast<float>((1.0 - kSquareError) * max_sq);
  none_above = static_cast<float>(std::max((1.0 + kSquareError) * max_sq, kSmallestSquare));
}

PatchPose PatchPose::without_limits() const {
  PatchPose pose = *this;
  pose.least = pose.none_below = 0.0F;
  pose.most = pose.none_above = std::numeric_limits<float>::max();
  return pose;
}

HWY_EXPORT(SurveyPatch);

PatchState survey_patch(const PatchPose& pose, const PatchPixels& pixels, Patch* patch) {
  return HWY_DYNAMIC_DISPATCH(SurveyPatch)(pose, pixels, patch);
}

}  // namespace ist
#endif
