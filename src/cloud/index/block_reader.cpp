#include "cloud/index/block_reader.h"

#include <algorithm>
#include <bitset>
#include <limits>

#include "cloud/format/point_reader.h"
#include "cloud/index/tile_reader.h"

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

}  // namespace

BlockReader::BlockReader(const RawCloud& cloud, const CropParameters& crop, IngestCounts* counts)
    : cloud_(cloud),
      crop_(crop),
      transform_(crop),
      without_limits_(transform_.without_limits()),
      region_(crop),
      holds_floats_(holds_floats(cloud)),
      counts_(*counts) {
  for (std::size_t slot = 0; slot < kSlots; ++slot) {
    offset_[slot] = static_cast<std::uint32_t>(tile_row(slot) * cloud.width + tile_column(slot));
  }
}

std::size_t BlockReader::bound(BlockBounds* block, bool* is_whole) {
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
  if (state == BlockState::kAll) std::fill_n(block->kept, kSlots, kWholeTile);
  const std::size_t kept =
      state == BlockState::kUnclear ? crop_in_double(block) : count_kept(state, *block);
  kept_ += kept;
  *is_whole = state == BlockState::kAll;
  return kept;
}

void BlockReader::read_kept(std::size_t slot, std::uint32_t kept, PointTile* tile) const {
  if (kept == kWholeTile) return read_tile(cloud_, crop_.X_OS, first_pixel(slot), tile);
  CropBatch batch;
  IngestCounts counted_before;
  crop_tile(cloud_, row_ + tile_row(slot), column_ + tile_column(slot), crop_, &batch,
            &counted_before);
  copy_kept(batch, cloud_.width, first_pixel(slot), tile);
}

std::size_t BlockReader::rows() const { return std::min(kBlockSide, cloud_.height - row_); }
std::size_t BlockReader::columns() const { return std::min(kBlockSide, cloud_.width - column_); }

// The pixels where they are in the message, if they can be read there.
BlockPixels BlockReader::pixels() {
  if (!holds_floats_ || received() < kBlockSide * kBlockSide) return copied();
  const std::uint8_t* first = bytes_of(cloud_, row_, column_) + cloud_.x;
  return {reinterpret_cast<const float*>(first), cloud_.point_step / sizeof(float),
          cloud_.row_step / sizeof(float)};
}

// The pixels copied as floats; NaN outside the cloud.
BlockPixels BlockReader::copied() {
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

void BlockReader::copy_depths(std::size_t row) {
  double x[kBlockSide], y[kBlockSide], z[kBlockSide];
  read_depth_pixels(cloud_, row_ + row, column_, columns(), x, y, z);
  for (std::size_t column = 0; column < columns(); ++column) {
    float* to = copied_pixel(row, column);
    to[0] = static_cast<float>(x[column]);
    to[1] = static_cast<float>(y[column]);
    to[2] = static_cast<float>(z[column]);
  }
}

// The pixels kept, after bound_block(); counts the others.
std::size_t BlockReader::count_kept(BlockState state, const BlockBounds& block) {
  if (state == BlockState::kAll) return kBlockSide * kBlockSide;
  counts_.not_a_number +=
      block.not_a_number - static_cast<std::uint32_t>(kBlockSide * kBlockSide - received());
  counts_.too_near += block.too_near;
  counts_.not_believed += block.not_believed;
  std::size_t count = 0;
  for (const std::uint32_t kept : block.kept) count += std::bitset<kSlots>(kept).count();
  return count;
}

// Decides in double, pixel by pixel, which are kept. @returns how many are
std::size_t BlockReader::crop_in_double(BlockBounds* bounds) {
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
    std::fill_n(bounds->kept, kSlots, kWholeTile);
  }
  return kept;
}

}  // namespace ist
