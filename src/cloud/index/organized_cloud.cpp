#include "cloud/index/organized_cloud.h"

#include <algorithm>
#include <array>
#include <bitset>

#include "cloud/index/block_bounds.h"
#include "cloud/index/block_reader.h"
#include "cloud/index/split_rule.h"
#include "cloud/index/tile_split_kernel.h"

namespace ist {
namespace {

// Reads an organized cloud block by block and hands its tiles to the builder.
class OrganizedReader {
 public:
  OrganizedReader(const RawCloud& cloud, const CropParameters& crop, const CloudFilters& filters,
                  PointBvhBuilder* builder, IngestCounts* counts)
      : width_(cloud.width),
        height_(cloud.height),
        crop_(crop),
        blocks_(cloud, crop, counts),
        on_robot_(filters.on_robot),
        view_(on_robot_ != nullptr ? filters.view : nullptr),
        zones_(filters.zones),
        builder_(*builder),
        counts_(*counts) {
    SelfFilter* const on_robot = on_robot_;
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
    if (zones_ == nullptr) return;
    drop_in_zone_ = [this](const PointTile& tile, const PaddedBox& /*box*/) {
      return with_zones(*zones_, tile, 0, &counts_);
    };
    drop_any_ = [this](const PointTile& tile, const PaddedBox& box) {
      return with_zones(*zones_, tile, drop_(tile, box), &counts_);
    };
  }

  std::size_t run() {
    for_each_block([this] { read_block(); });
    return blocks_.kept();
  }

  // Looks at the blocks near the robot, without adding anything. @returns ViewFilter::end_pass()
  bool look_at_robot(LookedBlocks* looked) {
    looked->blocks.resize(blocks_in(height_) * blocks_in(width_));
    LookedBlocks::Block* block = looked->blocks.data();
    for_each_block([this, &block] { look_at_block(block++); });
    looked->kept = blocks_.kept();
    return view_->end_pass();
  }

  // run() for a cloud that look_at_robot() has looked at.
  std::size_t run_looked(const LookedBlocks& looked) {
    const LookedBlocks::Block* block = looked.blocks.data();
    for_each_block([this, &block] {
      if (block->kept != 0) add_block(block->bounds, block->is_whole, block->is_on_robot);
      ++block;
    });
    return looked.kept;
  }

 private:
  static constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);

  static std::size_t blocks_in(std::size_t pixels) {
    return (pixels + kBlockSide - 1) / kBlockSide;
  }

  template <typename Visit>
  void for_each_block(const Visit& visit) {
    for (std::size_t row = 0; row < height_; row += kBlockSide) {
      for (std::size_t column = 0; column < width_; column += kBlockSide) {
        blocks_.move_to(row, column);
        visit();
      }
    }
  }

  void read_block() {
    bool is_whole = false;
    if (blocks_.bound(&bounds_, &is_whole) == 0) return;
    add_block(bounds_, is_whole, on_robot_ != nullptr && on_robot_->begin_group(box_of(bounds_)));
  }

  void add_block(const BlockBounds& block, bool is_whole, bool is_near_robot) {
    using InZone = ZoneFilter::Verdict;
    const InZone zone = zones_ != nullptr ? zones_->test(box_of(block)) : InZone::kNone;
    if (zone == InZone::kAll) return leave_out(block);
    const std::uint32_t candidates = split_candidates(block);
    const bool is_filtered = is_near_robot || zone != InZone::kNone;
    if (is_whole && candidates == 0 && !is_filtered && add_as_node(block)) return;
    add_tiles(block, candidates, is_near_robot, zone != InZone::kNone);
  }

  void leave_out(const BlockBounds& block) {
    for (std::size_t slot = 0; slot < kSlots; ++slot) leave_out(block.kept[slot]);
  }
  // @param kept  bit k: a point is in slot k
  void leave_out(std::uint32_t kept) {
    counts_.in_zones += static_cast<std::uint32_t>(std::bitset<32>(kept).count());
  }

  // Drops the points of a tile that one of the filters has left undecided.
  // @param is_read  the tile is read as it is, in the box that the self-filter has tested last
  const PointFilter& filter_for(SelfFilter::Verdict robot, bool is_in_zone, bool is_read) const {
    static const PointFilter kDropNone;
    const bool is_clear = robot == SelfFilter::Verdict::kClear;
    if (is_in_zone) return is_clear ? drop_in_zone_ : drop_any_;
    if (is_clear) return kDropNone;
    return is_read ? drop_undecided_ : drop_;
  }

  // Shows the view filter the tiles that the self-filter cannot prove to be clear of the robot.
  void look_at_block(LookedBlocks::Block* looked) {
    const BlockBounds& block = looked->bounds;
    looked->kept = static_cast<std::uint32_t>(blocks_.bound(&looked->bounds, &looked->is_whole));
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
      view_->add_tile(blocks_.row() + tile_row(slot), blocks_.column() + tile_column(slot), kept,
                      *on_robot_, verdict, crop_.X_OS);
    }
  }

  // Bit k: the view filter takes the point in slot k for the robot's.
  std::uint32_t viewed(const PointTile& tile) const {
    std::uint32_t mask = 0;
    for (std::int32_t k = 0; k < tile.count; ++k) {
      const std::size_t row = tile.id[k] / width_, column = tile.id[k] % width_;
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
        view_->robot_mask(blocks_.row() + tile_row(slot), blocks_.column() + tile_column(slot));
    if (robot == nullptr || *robot == 0) return Verdict::kClear;
    return *robot == kept ? Verdict::kOnRobot : Verdict::kUndecided;
  }

  // Adds all sixteen tiles as a node, not loaded: the usual case where a camera sees well. @returns
  // false, and adds nothing, where the tiles have to be looked at one by one.
  bool add_as_node(const BlockBounds& block) {
    if (!are_close_together(box_of(block).diagonal(), block.diagonals, kPointWidth)) return false;
    std::array<std::uint32_t, kSlots> first;
    for (std::size_t slot = 0; slot < kSlots; ++slot) first[slot] = blocks_.first_pixel(slot);
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
  void add_tiles(const BlockBounds& block, std::uint32_t candidates, bool is_near_robot,
                 bool is_near_zone) {
    using Verdict = SelfFilter::Verdict;
    using InZone = ZoneFilter::Verdict;
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::uint32_t kept = block.kept[slot];
      if (kept == 0) continue;
      const PaddedBox box = box_in(block.boxes, static_cast<int>(slot));
      const bool may_split = (candidates >> slot & 1U) != 0;
      const Verdict robot = is_near_robot ? judge(slot, kept, box) : Verdict::kClear;
      if (robot == Verdict::kOnRobot) continue;
      const InZone zone = is_near_zone ? zones_->test(box) : InZone::kNone;
      if (zone == InZone::kAll) {
        leave_out(kept);
        continue;
      }
      const bool is_in_zone = zone == InZone::kSome;
      if (kept == kWholeTile && !may_split && robot == Verdict::kClear && !is_in_zone) {
        builder_.add_lazy_tile(box, blocks_.first_pixel(slot));
        continue;
      }
      if (may_split) {
        PointTile tile;
        blocks_.read_kept(slot, kept, &tile);
        add_parts(tile, (1U << static_cast<std::uint32_t>(tile.count)) - 1U, box,
                  filter_for(robot, is_in_zone, false));
      } else {
        blocks_.read_kept(slot, kept, builder_.next_tiles(1));
        builder_.add_tile(box, filter_for(robot, is_in_zone, true));
      }
    }
    builder_.end_group();
  }

  // Bit k: the tile in slot k may have to be split. Whole tiles without a depth discontinuity need
  // no split; nor do others that are about as long as those.
  static std::uint32_t split_candidates(const BlockBounds& block) {
    if (block.may_have_edge == 0 && std::all_of(block.kept, block.kept + kSlots,
                                                [](std::uint32_t k) { return k == kWholeTile; })) {
      return 0;
    }
    std::uint32_t undecided = 0;
    float sum = 0.0F, count = 0.0F;
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      const std::uint32_t bit = 1U << slot;
      if (block.kept[slot] == 0) continue;
      if (block.kept[slot] != kWholeTile || (block.may_have_edge & bit) != 0) {
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

  const std::size_t width_, height_;  // [pixels]
  const CropParameters& crop_;
  BlockReader blocks_;
  SelfFilter* on_robot_;
  ViewFilter* view_;
  const ZoneFilter* zones_;
  PointFilter drop_, drop_undecided_, drop_in_zone_, drop_any_;
  PointBvhBuilder& builder_;
  IngestCounts& counts_;
  BlockBounds bounds_;  // of read_block()
};

}  // namespace

bool look_at_robot(const RawCloud& cloud, const CropParameters& crop, SelfFilter* on_robot,
                   ViewFilter* view, PointBvhBuilder* builder, LookedBlocks* looked) {
  looked->counts = {};
  return OrganizedReader(cloud, crop, {on_robot, view, nullptr}, builder, &looked->counts)
      .look_at_robot(looked);
}

std::size_t index_organized(const RawCloud& cloud, const CropParameters& crop,
                            const CloudFilters& filters, const LookedBlocks* looked,
                            PointBvhBuilder* builder, PointBvh* bvh, IngestCounts* counts) {
  builder->start_organized(crop.X_FO, cloud, crop.X_OS, bvh);
  OrganizedReader reader(cloud, crop, filters, builder, counts);
  if (looked != nullptr) *counts = looked->counts;
  const std::size_t kept = looked != nullptr ? reader.run_looked(*looked) : reader.run();
  builder->finish();
  return kept;
}

}  // namespace ist
