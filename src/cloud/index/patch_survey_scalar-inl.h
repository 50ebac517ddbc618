// Surveys a patch of an image pixel by pixel, where there are no vectors. Compiled once per
// instruction set: to be included again for each.
#if defined(IST_PROXIMITY_PATCH_SURVEY_SCALAR_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_PATCH_SURVEY_SCALAR_INL_H
#undef IST_PROXIMITY_PATCH_SURVEY_SCALAR_INL_H
#else
#define IST_PROXIMITY_PATCH_SURVEY_SCALAR_INL_H
#endif

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
  for (std::size_t slot = 0; slot < kSlots; ++slot) {
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
  for (std::size_t slot = 0; slot < kSlots; ++slot) {
    for (int axis = 0; axis < 3; ++axis) {
      patch->min[axis] = std::min(patch->min[axis], mins[axis][slot] -= by);
      patch->max[axis] = std::max(patch->max[axis], maxs[axis][slot] += by);
    }
    patch->diagonals += std::sqrt(patch->diagonal_sq[slot]);
  }
  return kept_by_all == 0xFFFFU ? PatchState::kAll : PatchState::kSome;
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_PATCH_SURVEY_SCALAR_INL_H
