#include "cloud/image_tiles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "cloud/image_kernel.h"
#include "cloud/tile_box.h"

namespace ist {
namespace {

constexpr std::size_t kSampledBlocks = 64;

// A tile that is not known to be good may be this many times as long as those that are.
constexpr float kAsLong = 1.5F;

// Bits of the slots in the lower half of a box, across its longest side.
std::uint32_t lower_half(const PointTile& tile, const PaddedBox& box) {
  Eigen::Index axis;
  (box.max - box.min).maxCoeff(&axis);
  const float* along = axis == 0 ? tile.x : axis == 1 ? tile.y : tile.z;
  const float middle = 0.5F * (box.min[axis] + box.max[axis]);
  std::uint32_t bits = 0;
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(kPointWidth); ++k) {
    bits |= static_cast<std::uint32_t>(along[k] < middle) << k;
  }
  return bits;
}

// Of the points whose bit is set, one at least. Number by number: a vector made of three numbers
// that were just written waits for them.
PaddedBox box_of(const PointTile& tile, std::uint32_t points) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  float min_x = kInfinity, min_y = kInfinity, min_z = kInfinity;
  float max_x = -kInfinity, max_y = -kInfinity, max_z = -kInfinity;
  for (std::uint32_t k = 0; points >> k != 0; ++k) {
    if ((points >> k & 1U) == 0) continue;
    min_x = std::min(min_x, tile.x[k]);
    min_y = std::min(min_y, tile.y[k]);
    min_z = std::min(min_z, tile.z[k]);
    max_x = std::max(max_x, tile.x[k]);
    max_y = std::max(max_y, tile.y[k]);
    max_z = std::max(max_z, tile.z[k]);
  }
  return {{min_x, min_y, min_z, 0.0F}, {max_x, max_y, max_z, 0.0F}};
}

void copy_points(const PointTile& from, std::uint32_t points, PointTile* to) {
  to->count = 0;
  for (std::uint32_t k = 0; points >> k != 0; ++k) {
    if ((points >> k & 1U) == 0) continue;
    const std::int32_t n = to->count++;
    to->x[n] = from.x[k];
    to->y[n] = from.y[k];
    to->z[n] = from.z[k];
    to->id[n] = from.id[k];
  }
}

class ImageReader {
 public:
  ImageReader(const RawCloud& cloud, const CropPose& pose, const SelfFilter* on_robot,
              PointIndexBuilder* builder, IngestCounts* counts)
      : cloud_(cloud), pose_(pose), on_robot_(on_robot), builder_(*builder), counts_(*counts) {
    if (on_robot != nullptr) drop_ = on_robot->as_filter();
  }

  std::size_t run() {
    for (std::size_t row = 0; row < cloud_.height; row += kPatchSide) {
      for (std::size_t column = 0; column < cloud_.width; column += kPatchSide) {
        const std::size_t kept = crop_patch(cloud_, row, column, pose_, &block_, &counts_);
        if (kept == 0) continue;
        kept_ += kept;
        patch(row * cloud_.width + column);
      }
    }
    return kept_;
  }

 private:
  // @param first  pixel
  void patch(std::size_t first) {
    const auto id = static_cast<std::uint32_t>(first);
    const auto width = static_cast<std::uint32_t>(cloud_.width);
    find_tiles(block_, &tiles_);
    if (tiles_.is_plain() && keep_plain(id, width)) return;
    const Choice choice = choose();
    PointTile* room = builder_.room(kPointWidth);
    write_tiles(block_, tiles_, choice.as_they_are, id, width, room);
    tiles_.boxes.count = kPointWidth;
    if (on_robot_ != nullptr && on_robot_->may_drop(box_around(tiles_.boxes))) {
      keep_one_by_one(choice.as_they_are);
    } else {
      builder_.keep_written(tiles_.boxes, choice.as_they_are);
    }
    for (std::size_t slot = 0; slot < kPatchTiles * kPatchTiles; ++slot) {
      if ((choice.to_be_parted >> slot & 1U) == 0) continue;
      PointTile tile;
      write_tiles(block_, tiles_, 1U << slot, id, width, &tile);
      keep_parts(tile, box_in(tiles_.boxes, static_cast<int>(slot)));
    }
    builder_.end_neighbours();
  }

  // What most patches are, where a camera sees well: in a few steps what the rest does tile by
  // tile.
  bool keep_plain(std::uint32_t id, std::uint32_t width) {
    tiles_.boxes.count = kPointWidth;
    const PaddedBox around = box_around(tiles_.boxes);
    const float sum = LaneMap(tiles_.diagonal_sq).sqrt().sum();
    if (!lie_close_together(around.diagonal(), sum, kPointWidth)) return false;
    if (on_robot_ != nullptr && on_robot_->may_drop(around)) return false;
    write_tiles(block_, tiles_, 0xFFFFU, id, width, builder_.room(kPointWidth));
    builder_.keep_node(tiles_.boxes);
    return true;
  }

  // Slots of the tiles that stay as they are, and of those that may have a gap.
  struct Choice {
    std::uint32_t as_they_are = 0, to_be_parted = 0;
  };

  // Full tiles that are as long as their pixels are apart are good; others are when they are no
  // longer than those.
  Choice choose() const {
    Choice choice;
    std::uint32_t open = 0;
    float sum = 0.0F, count = 0.0F;
    for (std::size_t slot = 0; slot < kPatchTiles * kPatchTiles; ++slot) {
      const std::uint32_t kept = tiles_.kept_of(slot), bit = 1U << slot;
      if (kept == 0) continue;
      if (kept != 0xFFFFU || (tiles_.suspicious & bit) != 0) {
        open |= bit;
      } else {
        choice.as_they_are |= bit;
        sum += tiles_.diagonal_sq[slot];
        count += 1.0F;
      }
    }
    const float longest_sq = kAsLong * kAsLong * sum;
    for (std::size_t slot = 0; open >> slot != 0; ++slot) {
      if ((open >> slot & 1U) == 0) continue;
      const bool good = count > 0.0F && tiles_.diagonal_sq[slot] * count <= longest_sq;
      (good ? choice.as_they_are : choice.to_be_parted) |= 1U << slot;
    }
    return choice;
  }

  // What the filter drops moves all that follow.
  void keep_one_by_one(std::uint32_t which) {
    std::array<PointTile, kPointWidth> tiles;
    const PointTile* written = builder_.room(kPointWidth);
    std::copy_n(written, kPointWidth, tiles.begin());
    std::size_t i = 0;
    for (std::size_t slot = 0; which >> slot != 0; ++slot) {
      if ((which >> slot & 1U) == 0) continue;
      *builder_.room(1) = tiles[i++];
      builder_.keep(box_in(tiles_.boxes, static_cast<int>(slot)), drop_);
    }
  }

  // Halves what has a gap in the middle of its longest side, and keeps the parts.
  void keep_parts(const PointTile& whole, const PaddedBox& whole_box) {
    struct Part {
      std::uint32_t points;  // bit k: that in slot k
      PaddedBox box;
    };
    std::array<Part, kPointWidth> parts;
    std::size_t count = 0;
    parts[count++] = {(1U << static_cast<std::uint32_t>(whole.count)) - 1U, whole_box};
    while (count > 0) {
      Part& part = parts[count - 1];
      const std::uint32_t low = lower_half(whole, part.box) & part.points;
      const std::uint32_t high = part.points & ~low;
      if (low != 0 && high != 0) {
        const PaddedBox low_box = box_of(whole, low), high_box = box_of(whole, high);
        if (is_worth_a_cut(low_box, high_box, part.box)) {
          part = {low, low_box};
          parts[count++] = {high, high_box};
          continue;
        }
      }
      copy_points(whole, part.points, builder_.room(1));
      builder_.keep(part.box, drop_);
      --count;
    }
  }

  const RawCloud& cloud_;
  const CropPose& pose_;
  const SelfFilter* on_robot_;
  PointFilter drop_;
  PointIndexBuilder& builder_;
  IngestCounts& counts_;
  CropBlock block_;
  PatchTiles tiles_;
  std::size_t kept_ = 0;
};

// Of sampled blocks.
class Numbers {
 public:
  void add(float value) { values_[size_++] = value; }
  std::size_t size() const { return size_; }
  float quantile(std::size_t tenths) {
    const auto at = values_.begin() + static_cast<std::ptrdiff_t>(size_ * tenths / 10);
    std::nth_element(values_.begin(), at, values_.begin() + static_cast<std::ptrdiff_t>(size_));
    return *at;
  }
  /// Of the middle four fifths.
  float span() { return quantile(9) - quantile(1); }

 private:
  std::array<float, 2 * kSampledBlocks> values_;
  std::size_t size_ = 0;
};

}  // namespace

bool is_image(const RawCloud& cloud, const CropPose& pose) {
  if (cloud.width < kPatchSide || cloud.height < kTileSide) return false;
  const std::size_t across = cloud.width / kTileSide, blocks = across * (cloud.height / kTileSide);
  // Not a divisor of the row: the samples are to be spread over the columns, too.
  const std::size_t step = std::max<std::size_t>(1, blocks / kSampledBlocks) | 1U;
  std::array<CropBlock, kTileSide> rows;
  Numbers size_sq, x, y, z;
  std::size_t kept = 0, seen = 0;
  IngestCounts unused;
  for (std::size_t i = 0; i < blocks; i += step) {
    Eigen::AlignedBox3f box;
    std::size_t here = 0;
    for (std::size_t row = 0; row < kTileSide; ++row) {
      here += crop_points(cloud, i / across * kTileSide + row, i % across * kTileSide, kTileSide,
                          pose, &rows[row], &unused);
      for (std::size_t k = 0; k < kTileSide; ++k) {
        const CropBlock& r = rows[row];
        if (r.x[k] == r.x[k]) box.extend(Eigen::Vector3f(r.x[k], r.y[k], r.z[k]));
      }
    }
    kept += here;
    seen += kTileSide * kTileSide;
    if (here < kTileSide * kTileSide / 2) continue;
    size_sq.add(box.diagonal().squaredNorm());
    x.add(box.center().x());
    y.add(box.center().y());
    z.add(box.center().z());
  }
  if (size_sq.size() < kSampledBlocks / 8) return false;
  const Eigen::Vector3f spread(x.span(), y.span(), z.span());
  // On a surface that size n points make squares of sixteen this large; a few times that will do.
  const float points =
      static_cast<float>(cloud.size()) * static_cast<float>(kept) / static_cast<float>(seen);
  constexpr float kFewTimes = 4.0F;
  const float largest_sq =
      kFewTimes * kFewTimes * spread.squaredNorm() * static_cast<float>(kPointWidth) / points;
  return size_sq.quantile(5) <= largest_sq;
}

std::size_t index_image(const RawCloud& cloud, const CropPose& pose, const SelfFilter* on_robot,
                        PointIndexBuilder* builder, PointIndex* index, IngestCounts* counts) {
  builder->start(pose.X_FO, index);
  const std::size_t kept = ImageReader(cloud, pose, on_robot, builder, counts).run();
  builder->finish();
  return kept;
}

}  // namespace ist
