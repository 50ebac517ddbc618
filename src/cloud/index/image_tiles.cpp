#include "cloud/index/image_tiles.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstring>
#include <limits>

#include "cloud/format/point_reader.h"
#include "cloud/index/image_kernel.h"
#include "cloud/index/tile_box.h"
#include "cloud/index/tile_kernel.h"
#include "cloud/index/tile_reader.h"

namespace ist {
namespace {

// A tile that is not known to be good may be this many times as long as those that are.
constexpr float kAsLong = 1.5F;

// Whether pixels can be read in blocks of four floats, the coordinates first, where they are.
bool holds_floats(const RawCloud& cloud) {
  const auto is_aligned = [](std::size_t bytes) { return bytes % sizeof(float) == 0; };
  return !cloud.is_double && !cloud.swap_bytes && cloud.y == cloud.x + sizeof(float) &&
         cloud.z == cloud.x + 2 * sizeof(float) &&
         cloud.x + 4 * sizeof(float) <= cloud.point_step && is_aligned(cloud.point_step) &&
         is_aligned(cloud.row_step) &&
         is_aligned(reinterpret_cast<std::uintptr_t>(cloud.data) + cloud.x);
}

// How a box lies to the region, as far as float tells.
enum class Side { kWithin, kBeyond, kAcross };

// Where an image is cut.
class Cut {
 public:
  explicit Cut(const CropPose& pose)
      : center_O_(pose.X_OS * pose.region_center), radius_sq_(pose.region_radius_sq) {}

  Side side_of(const Patch& patch) const {
    if (radius_sq_ == std::numeric_limits<double>::infinity()) return Side::kWithin;
    double nearest_sq = 0.0, farthest_sq = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double below = static_cast<double>(patch.min[i]) - center_O_[i],
                   above = static_cast<double>(patch.max[i]) - center_O_[i];
      const double farthest = std::max(-below, above), nearest = std::max({below, -above, 0.0});
      farthest_sq += farthest * farthest;
      nearest_sq += nearest * nearest;
    }
    constexpr double kSlack = 1e-6;  // far more than double loses
    if (farthest_sq * (1.0 + kSlack) <= radius_sq_) return Side::kWithin;
    return nearest_sq * (1.0 - kSlack) > radius_sq_ ? Side::kBeyond : Side::kAcross;
  }

 private:
  Eigen::Vector3d center_O_;
  double radius_sq_;
};

class ImageReader {
 public:
  ImageReader(const RawCloud& cloud, const CropPose& pose, const SelfFilter* on_robot,
              PointBvhBuilder* builder, IngestCounts* counts)
      : cloud_(cloud),
        pose_(pose),
        patch_pose_(pose),
        anywhere_(patch_pose_.without_limits()),
        cut_(pose),
        holds_floats_(holds_floats(cloud)),
        on_robot_(on_robot),
        builder_(*builder),
        counts_(*counts) {
    if (on_robot != nullptr) drop_ = on_robot->as_filter();
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      offset_[slot] = static_cast<std::uint32_t>(tile_row(slot) * cloud.width + tile_column(slot));
    }
  }

  std::size_t run() {
    for (row_ = 0; row_ < cloud_.height; row_ += kPatchSide) {
      for (column_ = 0; column_ < cloud_.width; column_ += kPatchSide) read_patch();
    }
    return kept_;
  }

 private:
  static constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
  static constexpr std::uint32_t kWhole = 0xFFFFU;  // a tile of which all pixels are kept

  void read_patch() {
    PatchState state = survey_patch(patch_pose_, pixels(), &patch_);
    if (state == PatchState::kNone) {
      counts_.not_a_number += static_cast<std::uint32_t>(received());
      return;
    }
    if (state != PatchState::kUnclear) {
      const Side side = cut_.side_of(patch_);
      if (side == Side::kAcross) state = PatchState::kUnclear;
      if (side == Side::kBeyond) {
        counts_.outside_region += static_cast<std::uint32_t>(count_kept(state));
        return;
      }
    }
    if (state == PatchState::kAll) std::fill_n(patch_.kept, kSlots, kWhole);
    const std::size_t kept = state == PatchState::kUnclear ? look_closely() : count_kept(state);
    if (kept == 0) return;
    kept_ += kept;
    const std::uint32_t gaps = find_gaps();
    if (state != PatchState::kAll || gaps != 0 || !keep_plain()) keep_tiles(gaps);
  }

  std::size_t rows() const { return std::min(kPatchSide, cloud_.height - row_); }
  std::size_t columns() const { return std::min(kPatchSide, cloud_.width - column_); }
  std::size_t received() const { return rows() * columns(); }
  std::uint32_t first_pixel(std::size_t slot) const {
    return static_cast<std::uint32_t>(row_ * cloud_.width + column_) + offset_[slot];
  }

  // Where they are in the message, if possible.
  PatchPixels pixels() {
    if (!holds_floats_ || received() < kPatchSide * kPatchSide) return copied();
    const std::uint8_t* first = bytes_of(cloud_, row_, column_) + cloud_.x;
    return {reinterpret_cast<const float*>(first), cloud_.point_step / sizeof(float),
            cloud_.row_step / sizeof(float)};
  }

  // As floats; NaN beyond the image's edges.
  PatchPixels copied() {
    std::fill_n(copy_, 4 * kPatchSide * kPatchSide, std::numeric_limits<float>::quiet_NaN());
    for (std::size_t row = 0; row < rows(); ++row) {
      for (std::size_t column = 0; column < columns(); ++column) {
        const Eigen::Vector3d p = point_at(cloud_, row_ + row, column_ + column);
        float* to = copied_pixel(row, column);
        for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(p[i]);
      }
    }
    return {copy_, 4, 4 * kPatchSide};
  }
  float* copied_pixel(std::size_t row, std::size_t column) {
    return copy_ + 4 * (kPatchSide * row + column);
  }

  // As surveyed; what is NaN is noted.
  std::size_t count_kept(PatchState state) {
    if (state == PatchState::kAll) return kPatchSide * kPatchSide;
    counts_.not_a_number +=
        patch_.not_a_number - static_cast<std::uint32_t>(kPatchSide * kPatchSide - received());
    std::size_t count = 0;
    for (const std::uint32_t kept : patch_.kept) count += std::bitset<kSlots>(kept).count();
    return count;
  }

  // Pixel by pixel in double, which decides. @returns how many are kept
  std::size_t look_closely() {
    CropBlock block;
    std::size_t kept = 0;
    copied();
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::size_t row = tile_row(slot), column = tile_column(slot);
      if (row >= rows() || column >= columns()) continue;
      kept += crop_tile(cloud_, row_ + row, column_ + column, pose_, &block, &counts_);
      for (std::size_t k = 0; k < kSlots; ++k) {
        if (block.x[k] == block.x[k]) continue;
        copied_pixel(row + k / kTileSide, column + k % kTileSide)[0] =
            std::numeric_limits<float>::quiet_NaN();
      }
    }
    if (survey_patch(anywhere_, {copy_, 4, 4 * kPatchSide}, &patch_) == PatchState::kAll) {
      std::fill_n(patch_.kept, kSlots, kWhole);
    }
    return kept;
  }

  // What most patches are, where a camera sees well: in a few steps what the rest does tile by
  // tile.
  bool keep_plain() {
    const PaddedBox around = box_around_patch();
    if (!lie_close_together(around.diagonal(), patch_.diagonals, kPointWidth)) return false;
    if (on_robot_ != nullptr && on_robot_->may_drop(around)) return false;
    std::array<std::uint32_t, kSlots> first;
    for (std::size_t slot = 0; slot < kSlots; ++slot) first[slot] = first_pixel(slot);
    builder_.keep_unread_node(patch_.boxes, first.data());
    return true;
  }

  PaddedBox box_around_patch() const {
    return {{patch_.min[0], patch_.min[1], patch_.min[2], 0.0F},
            {patch_.max[0], patch_.max[1], patch_.max[2], 0.0F}};
  }

  // @param gaps  slots of the tiles that may have one
  void keep_tiles(std::uint32_t gaps) {
    const bool is_near_robot = on_robot_ != nullptr && on_robot_->may_drop(box_around_patch());
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::uint32_t kept = patch_.kept[slot];
      if (kept == 0) continue;
      const PaddedBox box = box_in(patch_.boxes, static_cast<int>(slot));
      const bool may_have_gap = (gaps >> slot & 1U) != 0;
      const bool may_be_robot = is_near_robot && on_robot_->may_drop(box);
      if (kept == kWhole && !may_have_gap && !may_be_robot) {
        builder_.keep_unread(box, first_pixel(slot));
        continue;
      }
      if (may_have_gap) {
        PointTile tile;
        read_kept(slot, &tile);
        keep_parts(tile, (1U << static_cast<std::uint32_t>(tile.count)) - 1U, box);
      } else {
        read_kept(slot, builder_.room(1));
        builder_.keep(box, drop_);
      }
    }
    builder_.end_neighbours();
  }

  void read_kept(std::size_t slot, PointTile* tile) const {
    if (patch_.kept[slot] == kWhole) {
      return read_tile(cloud_, pose_.X_OS, first_pixel(slot), tile);
    }
    CropBlock block;
    IngestCounts counted_before;
    crop_tile(cloud_, row_ + tile_row(slot), column_ + tile_column(slot), pose_, &block,
              &counted_before);
    copy_kept(block, cloud_.width, first_pixel(slot), tile);
  }

  // Slots of the tiles that may have a gap. Full tiles that are as long as their pixels are apart
  // have none; nor do others that are not much longer than those.
  std::uint32_t find_gaps() const {
    if (patch_.suspicious == 0 && std::all_of(patch_.kept, patch_.kept + kSlots,
                                              [](std::uint32_t k) { return k == kWhole; })) {
      return 0;
    }
    std::uint32_t open = 0;
    float sum = 0.0F, count = 0.0F;
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::uint32_t bit = 1U << slot;
      if (patch_.kept[slot] == 0) continue;
      if (patch_.kept[slot] != kWhole || (patch_.suspicious & bit) != 0) {
        open |= bit;
      } else {
        sum += patch_.diagonal_sq[slot];
        count += 1.0F;
      }
    }
    const float longest_sq = kAsLong * kAsLong * sum;
    std::uint32_t gaps = 0;
    for (std::size_t slot = 0; open >> slot != 0; ++slot) {
      if ((open >> slot & 1U) == 0) continue;
      const bool good = count > 0.0F && patch_.diagonal_sq[slot] * count <= longest_sq;
      if (!good) gaps |= 1U << slot;
    }
    return gaps;
  }

  // Splits points at a gap in the middle of their box's longest side, and keeps the parts. Each
  // split takes one point at least, so the recursion is at most fifteen calls deep.
  // @param points  bit k: the point in slot k belongs
  void keep_parts(const PointTile& whole, std::uint32_t points, const PaddedBox& box) {
    const TileHalves halves = halve_tile(whole, points, box);
    if (halves.low != 0 && halves.high != 0 &&
        is_worth_a_cut(halves.low_box, halves.high_box, box)) {
      keep_parts(whole, halves.high, halves.high_box);
      keep_parts(whole, halves.low, halves.low_box);
      return;
    }
    pick_points(whole, points, builder_.room(1));
    builder_.keep(box, drop_);
  }

  const RawCloud& cloud_;
  const CropPose& pose_;
  const PatchPose patch_pose_, anywhere_;
  const Cut cut_;
  const bool holds_floats_;
  const SelfFilter* on_robot_;
  PointFilter drop_;
  PointBvhBuilder& builder_;
  IngestCounts& counts_;
  std::array<std::uint32_t, kSlots> offset_;  // [pixels] by slot
  std::size_t row_ = 0, column_ = 0;          // of the patch at work
  Patch patch_;
  alignas(64) float copy_[4 * kPatchSide * kPatchSide];
  std::size_t kept_ = 0;
};

}  // namespace

std::size_t index_image(const RawCloud& cloud, const CropPose& pose, const SelfFilter* on_robot,
                        PointBvhBuilder* builder, PointBvh* index, IngestCounts* counts) {
  builder->start_image(pose.X_FO, cloud, pose.X_OS, index);
  const std::size_t kept = ImageReader(cloud, pose, on_robot, builder, counts).run();
  builder->finish();
  return kept;
}

}  // namespace ist
