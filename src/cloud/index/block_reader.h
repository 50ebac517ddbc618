#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "cloud/filters/crop.h"
#include "cloud/index/block_bounds.h"
#include "cloud/index/region_test.h"
#include "internal/cloud/point_tile.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Reads an organized cloud block by block: finds which pixels are kept, and the bounds of their
/// tiles. Not thread safe.
class BlockReader {
 public:
  /// @param cloud, crop  outlive this
  /// @param counts       outlives this; `not_a_number`, `infinite`, `outside_region`,
  ///   `too_near` and `not_believed` are counted
  BlockReader(const RawCloud& cloud, const CropParameters& crop, IngestCounts* counts);

  /// The next calls are for the block that begins at this pixel.
  void move_to(std::size_t row, std::size_t column) {
    row_ = row;
    column_ = column;
  }
  std::size_t row() const { return row_; }
  std::size_t column() const { return column_; }

  /// Bounds the block and counts its pixels, once for each block.
  /// @param is_whole  receives whether all pixels are kept, none of them near a limit
  /// @returns how many are kept
  std::size_t bound(BlockBounds* block, bool* is_whole);
  /// How many pixels of all blocks that bound() has seen are kept.
  std::size_t kept() const { return kept_; }

  /// The number in the message of the first pixel of a tile of the block.
  std::uint32_t first_pixel(std::size_t slot) const {
    return static_cast<std::uint32_t>(row_ * cloud_.width + column_) + offset_[slot];
  }
  /// Reads the points of a tile of the block.
  /// @param kept  as in BlockBounds
  void read_kept(std::size_t slot, std::uint32_t kept, PointTile* tile) const;

 private:
  static constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);

  std::size_t rows() const;
  std::size_t columns() const;
  std::size_t received() const { return rows() * columns(); }
  BlockPixels pixels();
  BlockPixels copied();
  void copy_depths(std::size_t row);
  float* copied_pixel(std::size_t row, std::size_t column) {
    return copy_ + 4 * (kBlockSide * row + column);
  }
  std::size_t count_kept(BlockState state, const BlockBounds& block);
  std::size_t crop_in_double(BlockBounds* bounds);

  const RawCloud& cloud_;
  const CropParameters& crop_;
  const BlockTransform transform_, without_limits_;
  const RegionTest region_;
  const bool holds_floats_;
  IngestCounts& counts_;
  std::array<std::uint32_t, kSlots> offset_;  ///< [pixels] by slot
  std::size_t row_ = 0, column_ = 0;          ///< of the block
  std::size_t kept_ = 0;
  alignas(64) float copy_[4 * kBlockSide * kBlockSide];  ///< of the block's pixels
};

}  // namespace ist
