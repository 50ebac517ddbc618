#include "cloud/index/organized_cloud.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstring>
#include <limits>

#include "cloud/format/point_reader.h"
#include "cloud/index/block_bounds.h"
#include "cloud/index/split_rule.h"
#include "cloud/index/tile_reader.h"
#include "cloud/index/tile_split_kernel.h"

namespace ist {
namespace {

// Whether pixels can be read from the message as four floats each, the coordinates first.
bool holds_floats(const RawCloud& cloud) {
  const auto is_aligned = [](std::size_t bytes) { return bytes % sizeof(float) == 0; };
  return cloud.depth == DepthType::kNone && !cloud.is_double && !cloud.swap_bytes &&
         cloud.y == cloud.x + sizeof(float) && cloud.z == cloud.x + 2 * sizeof(float) &&
         cloud.x + 4 * sizeof(float) <= cloud.point_step && is_aligned(cloud.point_step) &&
         is_aligned(cloud.row_step) &&
         is_aligned(reinterpret_cast<std::uintptr_t>(cloud.data) + cloud.x);
}

// The place of a box with respect to the region of interest.
enum class RegionSide { kInside, kOutside, kCrossing };

// The region of interest in the frame O.
class RegionTest {
 public:
  explicit RegionTest(const CropParameters& crop)
      : center_O_(crop.X_OS * crop.region_center), radius_sq_(crop.region_radius_sq) {}

  RegionSide side_of(const BlockBounds& block) const {
    if (radius_sq_ == std::numeric_limits<double>::infinity()) return RegionSide::kInside;
    double nearest_sq = 0.0, farthest_sq = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double below = static_cast<double>(block.min[i]) - center_O_[i],
                   above = static_cast<double>(block.max[i]) - center_O_[i];
      const double farthest = std::max(-below, above), nearest = std::max({below, -above, 0.0});
      farthest_sq += farthest * farthest;
      nearest_sq += nearest * nearest;
    }
    constexpr double kSlack = 1e-6;  // far more than the rounding of double
    if (farthest_sq * (1.0 + kSlack) <= radius_sq_) return RegionSide::kInside;
    return nearest_sq * (1.0 - kSlack) > radius_sq_ ? RegionSide::kOutside : RegionSide::kCrossing;
  }

 private:
  Eigen::Vector3d center_O_;
  double radius_sq_;
};

// Reads an organized cloud block by block and hands its tiles to the builder.
class OrganizedReader {
 public:
  OrganizedReader(const RawCloud& cloud, const CropParameters& crop, SelfFilter* on_robot,
                  ViewFilter* view, PointBvhBuilder* builder, IngestCounts* counts)
      : cloud_(cloud),
        crop_(crop),
        transform_(crop),
        without_limits_(transform_.without_limits()),
        region_(crop),
        holds_floats_(holds_floats(cloud)),
        on_robot_(on_robot),
        view_(on_robot != nullptr ? view : nullptr),
        builder_(*builder),
        counts_(*counts) {
    if (view_ != nullptr) {
      drop_ = [this](const PointTile& tile, const PaddedBox& /*box*/) { return viewed(tile); };
      drop_undecided_ = drop_;
    } else if (on_robot != nullptr) {
      drop_ = [on_robot](const PointTile& tile, const PaddedBox& box) {
        return on_robot->points_on_robot(tile, box);
      };
      drop_undecided_ = [on_robot](const PointTile& tile, const PaddedBox& /*box*/) {
        return on_robot->undecided_points_on_robot(tile);
      };
    }
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      offset_[slot] = static_cast<std::uint32_t>(tile_row(slot) * cloud.width + tile_column(slot));
    }
  }

  std::size_t run() {
    for (row_ = 0; row_ < cloud_.height; row_ += kBlockSide) {
      for (column_ = 0; column_ < cloud_.width; column_ += kBlockSide) read_block();
    }
    return kept_;
  }

  // Looks at the blocks near the robot, without adding anything. @returns ViewFilter::end_pass()
  bool look_at_robot(LookedBlocks* looked) {
    looked->blocks.resize(blocks_in(cloud_.height) * blocks_in(cloud_.width));
    LookedBlocks::Block* block = looked->blocks.data();
    for (row_ = 0; row_ < cloud_.height; row_ += kBlockSide) {
      for (column_ = 0; column_ < cloud_.width; column_ += kBlockSide) look_at_block(block++);
    }
    looked->kept = kept_;
    return view_->end_pass();
  }

  // run() for a cloud that look_at_robot() has looked at.
  std::size_t run_looked(const LookedBlocks& looked) {
    counts_ = looked.counts;
    const LookedBlocks::Block* block = looked.blocks.data();
    for (row_ = 0; row_ < cloud_.height; row_ += kBlockSide) {
      for (column_ = 0; column_ < cloud_.width; column_ += kBlockSide, ++block) {
        if (block->kept != 0) add_block(block->bounds, block->is_whole, block->is_on_robot);
      }
    }
    return looked.kept;
  }

 private:
  static constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
  static constexpr std::uint32_t kWhole = 0xFFFFU;  // all pixels of a tile are kept

  static std::size_t blocks_in(std::size_t pixels) {
    return (pixels + kBlockSide - 1) / kBlockSide;
  }

  void read_block() {
    bool is_whole = false;
    if (bound(&bounds_, &is_whole) == 0) return;
    add_block(bounds_, is_whole, on_robot_ != nullptr && on_robot_->begin_group(box_of(bounds_)));
  }

  // Bounds the current block and counts its pixels.
  // @param is_whole  receives whether all pixels are kept, none of them near a limit
  // @returns how many are kept
  std::size_t bound(BlockBounds* block, bool* is_whole) {
    BlockState state = bound_block(transform_, pixels(), block);
    if (state == BlockState::kNone) {
      counts_.not_a_number += static_cast<std::uint32_t>(received());
      return 0;
    }
    if (state != BlockState::kUnclear) {
      const RegionSide side = region_.side_of(*block);
      if (side == RegionSide::kCrossing) state = BlockState::kUnclear;
      if (side == RegionSide::kOutside) {
        counts_.outside_region += static_cast<std::uint32_t>(count_kept(state, *block));
        return 0;
      }
    }
    if (state == BlockState::kAll) std::fill_n(block->kept, kSlots, kWhole);
    const std::size_t kept =
        state == BlockState::kUnclear ? crop_in_double(block) : count_kept(state, *block);
    kept_ += kept;
    *is_whole = state == BlockState::kAll;
    return kept;
  }

  void add_block(const BlockBounds& block, bool is_whole, bool is_near_robot) {
    const std::uint32_t candidates = split_candidates(block);
    if (is_whole && candidates == 0 && !is_near_robot && add_as_node(block)) return;
    add_tiles(block, candidates, is_near_robot);
  }

  // Shows the view filter the tiles that the self-filter cannot prove to be clear of the robot.
  void look_at_block(LookedBlocks::Block* looked) {
    const BlockBounds& block = looked->bounds;
    looked->kept = static_cast<std::uint32_t>(bound(&looked->bounds, &looked->is_whole));
    looked->is_on_robot = false;
    if (looked->kept == 0 || !on_robot_->begin_group(box_of(block))) return;
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::uint32_t kept = block.kept[slot];
      if (kept == 0) continue;
      const PaddedBox box = box_in(block.boxes, static_cast<int>(slot));
      const SelfFilter::Verdict verdict = on_robot_->test(box);
      if (verdict == SelfFilter::Verdict::kClear) {
        const Eigen::Vector3f middle = 0.5F * (box.min + box.max).head<3>();
        view_->add_outside(crop_.X_FO * middle.cast<double>());
        continue;
      }
      looked->is_on_robot = true;
      view_->add_tile(row_ + tile_row(slot), column_ + tile_column(slot), kept, *on_robot_, verdict,
                      crop_.X_OS);
    }
  }

  // Bit k: the view filter takes the point in slot k for the robot's.
  std::uint32_t viewed(const PointTile& tile) const {
    std::uint32_t mask = 0;
    for (std::int32_t k = 0; k < tile.count; ++k) {
      const std::size_t row = tile.id[k] / cloud_.width, column = tile.id[k] % cloud_.width;
      const std::uint16_t* robot = view_->robot_mask(row, column);
      const std::size_t pixel = kTileSide * (row % kTileSide) + column % kTileSide;
      if (robot != nullptr) mask |= (*robot >> pixel & 1U) << static_cast<std::uint32_t>(k);
    }
    return mask;
  }

  // The treatment of a tile of a block near the robot.
  SelfFilter::Verdict judge(std::size_t slot, std::uint32_t kept, const PaddedBox& box) {
    using Verdict = SelfFilter::Verdict;
    if (view_ == nullptr) return on_robot_->test(box);
    const std::uint16_t* robot =
        view_->robot_mask(row_ + tile_row(slot), column_ + tile_column(slot));
    if (robot == nullptr || *robot == 0) return Verdict::kClear;
    return *robot == kept ? Verdict::kOnRobot : Verdict::kUndecided;
  }

  std::size_t rows() const { return std::min(kBlockSide, cloud_.height - row_); }
  std::size_t columns() const { return std::min(kBlockSide, cloud_.width - column_); }
  std::size_t received() const { return rows() * columns(); }
  std::uint32_t first_pixel(std::size_t slot) const {
    return static_cast<std::uint32_t>(row_ * cloud_.width + column_) + offset_[slot];
  }

  // The pixels where they are in the message, if they can be read there.
  BlockPixels pixels() {
    if (!holds_floats_ || received() < kBlockSide * kBlockSide) return copied();
    const std::uint8_t* first = bytes_of(cloud_, row_, column_) + cloud_.x;
    return {reinterpret_cast<const float*>(first), cloud_.point_step / sizeof(float),
            cloud_.row_step / sizeof(float)};
  }

  // The pixels copied as floats; NaN outside the cloud.
  BlockPixels copied() {
    std::fill_n(copy_, 4 * kBlockSide * kBlockSide, std::numeric_limits<float>::quiet_NaN());
    for (std::size_t row = 0; row < rows(); ++row) {
      if (cloud_.depth != DepthType::kNone) {
        copy_depths(row);
        continue;
      }
      for (std::size_t column = 0; column < columns(); ++column) {
        const Eigen::Vector3d p = point_at(cloud_, row_ + row, column_ + column);
        float* to = copied_pixel(row, column);
        for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(p[i]);
      }
    }
    return {copy_, 4, 4 * kBlockSide};
  }
  void copy_depths(std::size_t row) {
    double x[kBlockSide], y[kBlockSide], z[kBlockSide];
    read_depth_pixels(cloud_, row_ + row, column_, columns(), x, y, z);
    for (std::size_t column = 0; column < columns(); ++column) {
      float* to = copied_pixel(row, column);
      to[0] = static_cast<float>(x[column]);
      to[1] = static_cast<float>(y[column]);
      to[2] = static_cast<float>(z[column]);
    }
  }
  float* copied_pixel(std::size_t row, std::size_t column) {
    return copy_ + 4 * (kBlockSide * row + column);
  }

  // The pixels kept, after bound_block(); counts those that are NaN.
  std::size_t count_kept(BlockState state, const BlockBounds& block) {
    if (state == BlockState::kAll) return kBlockSide * kBlockSide;
    counts_.not_a_number +=
        block.not_a_number - static_cast<std::uint32_t>(kBlockSide * kBlockSide - received());
    std::size_t count = 0;
    for (const std::uint32_t kept : block.kept) count += std::bitset<kSlots>(kept).count();
    return count;
  }

  // Decides in double, pixel by pixel, which are kept. @returns how many are
  std::size_t crop_in_double(BlockBounds* bounds) {
    CropBatch block;
    std::size_t kept = 0;
    copied();
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::size_t row = tile_row(slot), column = tile_column(slot);
      if (row >= rows() || column >= columns()) continue;
      kept += crop_tile(cloud_, row_ + row, column_ + column, crop_, &block, &counts_);
      for (std::size_t k = 0; k < kSlots; ++k) {
        if (block.x[k] == block.x[k]) continue;
        copied_pixel(row + k / kTileSide, column + k % kTileSide)[0] =
            std::numeric_limits<float>::quiet_NaN();
      }
    }
    if (bound_block(without_limits_, {copy_, 4, 4 * kBlockSide}, bounds) == BlockState::kAll) {
      std::fill_n(bounds->kept, kSlots, kWhole);
    }
    return kept;
  }

  // Adds all sixteen tiles as a node, not loaded: the usual case where a camera sees well. @returns
  // false, and adds nothing, where the tiles have to be looked at one by one.
  bool add_as_node(const BlockBounds& block) {
    if (!are_close_together(box_of(block).diagonal(), block.diagonals, kPointWidth)) return false;
    std::array<std::uint32_t, kSlots> first;
    for (std::size_t slot = 0; slot < kSlots; ++slot) first[slot] = first_pixel(slot);
    builder_.add_lazy_node(block.boxes, first.data());
    return true;
  }

  static PaddedBox box_of(const BlockBounds& block) {
    return {{block.min[0], block.min[1], block.min[2], 0.0F},
            {block.max[0], block.max[1], block.max[2], 0.0F}};
  }

  // Adds the tiles one by one. Only those that have to be split, have holes, or are at the
  // self-filter's border are read.
  // @param candidates  bit k: the tile in slot k may have to be split
  void add_tiles(const BlockBounds& block, std::uint32_t candidates, bool is_near_robot) {
    using Verdict = SelfFilter::Verdict;
    static const PointFilter kDropNone;
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::uint32_t kept = block.kept[slot];
      if (kept == 0) continue;
      const PaddedBox box = box_in(block.boxes, static_cast<int>(slot));
      const bool may_split = (candidates >> slot & 1U) != 0;
      const Verdict robot = is_near_robot ? judge(slot, kept, box) : Verdict::kClear;
      if (robot == Verdict::kOnRobot) continue;
      if (kept == kWhole && !may_split && robot == Verdict::kClear) {
        builder_.add_lazy_tile(box, first_pixel(slot));
        continue;
      }
      if (may_split) {
        PointTile tile;
        read_kept(slot, kept, &tile);
        add_parts(tile, (1U << static_cast<std::uint32_t>(tile.count)) - 1U, box,
                  robot == Verdict::kClear ? kDropNone : drop_);
      } else {
        read_kept(slot, kept, builder_.next_tiles(1));
        builder_.add_tile(box, robot == Verdict::kClear ? kDropNone : drop_undecided_);
      }
    }
    builder_.end_group();
  }

  void read_kept(std::size_t slot, std::uint32_t kept, PointTile* tile) const {
    if (kept == kWhole) {
      return read_tile(cloud_, crop_.X_OS, first_pixel(slot), tile);
    }
    CropBatch batch;
    IngestCounts counted_before;
    crop_tile(cloud_, row_ + tile_row(slot), column_ + tile_column(slot), crop_, &batch,
              &counted_before);
    copy_kept(batch, cloud_.width, first_pixel(slot), tile);
  }

  // Bit k: the tile in slot k may have to be split. Whole tiles without a depth discontinuity need
  // no split; nor do others that are about as long as those.
  static std::uint32_t split_candidates(const BlockBounds& block) {
    if (block.may_have_edge == 0 &&
        std::all_of(block.kept, block.kept + kSlots, [](std::uint32_t k) { return k == kWhole; })) {
      return 0;
    }
    std::uint32_t undecided = 0;
    float sum = 0.0F, count = 0.0F;
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::uint32_t bit = 1U << slot;
      if (block.kept[slot] == 0) continue;
      if (block.kept[slot] != kWhole || (block.may_have_edge & bit) != 0) {
        undecided |= bit;
      } else {
        sum += block.diagonal_sq[slot];
        count += 1.0F;
      }
    }
    std::uint32_t candidates = 0;
    for (std::size_t slot = 0; undecided >> slot != 0; ++slot) {
      if ((undecided >> slot & 1U) == 0) continue;
      if (!is_as_long_as(block.diagonal_sq[slot], sum, count)) candidates |= 1U << slot;
    }
    return candidates;
  }

  // Splits points in the middle of their box's longest side as long as that is worthwhile, and adds
  // the parts. Each split takes one point at least, so the recursion is at most fifteen calls deep.
  // @param points  bit k: the point in slot k belongs
  void add_parts(const PointTile& whole, std::uint32_t points, const PaddedBox& box,
                 const PointFilter& drop) {
    const TileHalves halves = halve_tile(whole, points, box);
    if (halves.low != 0 && halves.high != 0 &&
        is_split_worthwhile(halves.low_box, halves.high_box, box)) {
      add_parts(whole, halves.high, halves.high_box, drop);
      add_parts(whole, halves.low, halves.low_box, drop);
      return;
    }
    pick_points(whole, points, builder_.next_tiles(1));
    builder_.add_tile(box, drop);
  }

  const RawCloud& cloud_;
  const CropParameters& crop_;
  const BlockTransform transform_, without_limits_;
  const RegionTest region_;
  const bool holds_floats_;
  SelfFilter* on_robot_;
  ViewFilter* view_;
  PointFilter drop_, drop_undecided_;
  PointBvhBuilder& builder_;
  IngestCounts& counts_;
  std::array<std::uint32_t, kSlots> offset_;  // [pixels] by slot
  std::size_t row_ = 0, column_ = 0;          // of the current block
  BlockBounds bounds_;                        // of read_block()
  alignas(64) float copy_[4 * kBlockSide * kBlockSide];
  std::size_t kept_ = 0;
};

}  // namespace

bool look_at_robot(const RawCloud& cloud, const CropParameters& crop, SelfFilter* on_robot,
                   ViewFilter* view, PointBvhBuilder* builder, LookedBlocks* looked) {
  looked->counts = {};
  return OrganizedReader(cloud, crop, on_robot, view, builder, &looked->counts)
      .look_at_robot(looked);
}

std::size_t index_organized(const RawCloud& cloud, const CropParameters& crop, SelfFilter* on_robot,
                            ViewFilter* view, const LookedBlocks* looked, PointBvhBuilder* builder,
                            PointBvh* bvh, IngestCounts* counts) {
  builder->start_organized(crop.X_FO, cloud, crop.X_OS, bvh);
  OrganizedReader reader(cloud, crop, on_robot, view, builder, counts);
  const std::size_t kept = looked != nullptr ? reader.run_looked(*looked) : reader.run();
  builder->finish();
  return kept;
}

}  // namespace ist
