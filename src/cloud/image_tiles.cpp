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

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kSampledBlocks = 64;

// A plane's block is at most three times as long as its two steps from pixel to pixel together;
// what is longer is looked at closely.
constexpr float kLongest = 2.0F * 3.0F * 3.0F;

float squared_step(const PointTile& tile, int a, int b) {
  const float x = tile.x[a] - tile.x[b], y = tile.y[a] - tile.y[b], z = tile.z[a] - tile.z[b];
  return x * x + y * y + z * z;
}

// Whether a full block may span an edge in depth: at opposite corners the steps tell how far apart
// pixels are on its surfaces.
bool is_suspicious(const PointTile& tile, const PaddedBox& box) {
  const float across = std::min(squared_step(tile, 0, 1), squared_step(tile, 14, 15));
  const float down = std::min(squared_step(tile, 0, 4), squared_step(tile, 11, 15));
  return (box.max - box.min).matrix().squaredNorm() > kLongest * (across + down);
}

void copy_point(const PointTile& from, int k, PointTile* to) {
  const int n = to->count++;
  to->x[n] = from.x[k];
  to->y[n] = from.y[k];
  to->z[n] = from.z[k];
  to->id[n] = from.id[k];
}

class ImageReader {
 public:
  ImageReader(const RawCloud& cloud, const CropPose& pose, const PointFilter& drop,
              PointIndexBuilder* builder, IngestCounts* counts)
      : cloud_(cloud), pose_(pose), drop_(drop), builder_(*builder), counts_(*counts) {}

  std::size_t run() {
    for (std::size_t row = 0; row < cloud_.height; row += kTileSide) {
      for (std::size_t column = 0; column < cloud_.width; column += kCropBlock) {
        band(row, column, std::min(kCropBlock, cloud_.width - column));
      }
    }
    return kept_;
  }

 private:
  void band(std::size_t first_row, std::size_t first_column, std::size_t count) {
    const std::size_t padded = (count + kTileColumns - 1) / kTileColumns * kTileColumns;
    std::size_t kept = 0;
    for (std::size_t row = 0; row < kTileSide; ++row) {
      const bool is_there = first_row + row < cloud_.height;
      if (is_there) {
        kept +=
            crop_points(cloud_, first_row + row, first_column, count, pose_, &rows_[row], &counts_);
      }
      const std::size_t filled = is_there ? count : 0;
      std::fill(rows_[row].x + filled, rows_[row].x + padded, kNaN);
    }
    kept_ += kept;
    if (kept == 0) return;
    for (std::size_t column = 0; column < padded; column += kTileColumns) {
      tile_boxes(rows_.data(), column, &boxes_);
      for (std::size_t i = 0; i < kTilesAtOnce; ++i) {
        block(first_row * cloud_.width + first_column + column + kTileSide * i,
              column + kTileSide * i, kTileSide * i);
      }
    }
  }

  // @param id      of the first pixel
  // @param column  of the rows in work, @param slot  of the boxes
  void block(std::size_t id, std::size_t column, std::size_t slot) {
    std::uint32_t kept = 0;
    for (std::size_t row = 0; row < kTileSide; ++row) {
      kept |= (boxes_.kept[row] >> slot & 0xFU) << (kTileSide * row);
    }
    if (kept == 0) return;
    PointTile& tile = builder_.next();
    const bool is_full = kept == 0xFFFFU;
    if (is_full) {
      take_all(id, column, &tile);
    } else {
      take(kept, id, column, &tile);
    }
    const PaddedBox box = {{boxes_.min[0][slot], boxes_.min[1][slot], boxes_.min[2][slot], 0.0F},
                           {boxes_.max[0][slot], boxes_.max[1][slot], boxes_.max[2][slot], 0.0F}};
    if (is_full && !is_suspicious(tile, box)) {
      builder_.keep(box, drop_);
    } else {
      keep_parts(tile, box);
    }
  }

  void take_all(std::size_t id, std::size_t column, PointTile* tile) const {
    for (std::size_t row = 0; row < kTileSide; ++row) {
      constexpr std::size_t kBytes = kTileSide * sizeof(float);
      std::memcpy(tile->x + kTileSide * row, rows_[row].x + column, kBytes);
      std::memcpy(tile->y + kTileSide * row, rows_[row].y + column, kBytes);
      std::memcpy(tile->z + kTileSide * row, rows_[row].z + column, kBytes);
      for (std::size_t k = 0; k < kTileSide; ++k) {
        tile->id[kTileSide * row + k] = static_cast<std::uint32_t>(id + row * cloud_.width + k);
      }
    }
    tile->count = kPointWidth;
  }

  void take(std::uint32_t kept, std::size_t id, std::size_t column, PointTile* tile) const {
    std::int32_t n = 0;
    for (std::size_t pixel = 0; pixel < kTileSide * kTileSide; ++pixel) {
      if ((kept >> pixel & 1U) == 0) continue;
      const std::size_t row = pixel / kTileSide, k = pixel % kTileSide;
      tile->x[n] = rows_[row].x[column + k];
      tile->y[n] = rows_[row].y[column + k];
      tile->z[n] = rows_[row].z[column + k];
      tile->id[n] = static_cast<std::uint32_t>(id + row * cloud_.width + k);
      ++n;
    }
    tile->count = n;
  }

  // Halves what has a gap in the middle of its longest side, and keeps the parts.
  void keep_parts(const PointTile& whole, const PaddedBox& whole_box) {
    struct Part {
      PointTile tile;
      PaddedBox box;
    };
    std::array<Part, kPointWidth> parts;
    std::size_t count = 0;
    parts[count++] = {whole, whole_box};
    while (count > 0) {
      Part& part = parts[count - 1];
      Part low, high;
      if (halve(part.tile, part.box, &low.tile, &high.tile)) {
        low.box = box_of(low.tile);
        high.box = box_of(high.tile);
        if (is_worth_a_cut(low.box, high.box, part.box)) {
          part = low;
          parts[count++] = high;
          continue;
        }
      }
      builder_.next() = part.tile;
      builder_.keep(part.box, drop_);
      --count;
    }
  }

  static bool halve(const PointTile& tile, const PaddedBox& box, PointTile* low, PointTile* high) {
    Eigen::Index axis;
    (box.max - box.min).maxCoeff(&axis);
    const float* along = axis == 0 ? tile.x : axis == 1 ? tile.y : tile.z;
    const float middle = 0.5F * (box.min[axis] + box.max[axis]);
    low->count = high->count = 0;
    for (int k = 0; k < tile.count; ++k) copy_point(tile, k, along[k] < middle ? low : high);
    if (low->count == 0 || high->count == 0) return false;
    repeat_last(low);
    repeat_last(high);
    return true;
  }

  const RawCloud& cloud_;
  const CropPose& pose_;
  const PointFilter& drop_;
  PointIndexBuilder& builder_;
  IngestCounts& counts_;
  std::array<CropBlock, kTileSide> rows_;
  TileBoxes boxes_;
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
  if (cloud.width < kTileColumns || cloud.height < kTileSide) return false;
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

std::size_t index_image(const RawCloud& cloud, const CropPose& pose, const PointFilter& drop,
                        PointIndexBuilder* builder, PointIndex* index, IngestCounts* counts) {
  builder->start(pose.origin, index);
  const std::size_t kept = ImageReader(cloud, pose, drop, builder, counts).run();
  builder->finish();
  return kept;
}

}  // namespace ist
