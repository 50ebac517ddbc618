#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/format/cloud_point.h"
#include "internal/bvh/box_node.h"
#include "internal/bvh/padded_box.h"
#include "internal/cloud/point_tile.h"

namespace ist {

/// Points after the last that the functions below may read: the array must be that much longer.
constexpr std::size_t kPointSlack = 16;

/// The longest two sides of the box of some points [m].
struct BoxShape {
  float longest = 0.0F, second = 0.0F;
};

/// Finds the slice of each point: `count` slices of equal width, across the longest side of the
/// points' box.
/// @param points  one at least, and kPointSlack more that may be read
/// @param slices  by point; kPointSlack more may be written
/// @returns false: the points coincide, or nearly, and have no slices
bool find_slices(const CloudPoint* points, std::size_t n, std::int32_t count, std::int32_t* slices,
                 BoxShape* shape);

/// The box of some points.
/// @param points  one at least, and kPointSlack more that may be read
PaddedBox box_of(const CloudPoint* points, std::size_t n);

/// Tiles that are being made, and their boxes.
struct TileBatch {
  static constexpr std::size_t kMost = 1024;

  PointTile* tiles = nullptr;  ///< not owned; one for each point at least
  /// Boxes of exactly the points: of tile i in slot i % 16 of node i / 16.
  BoxNode boxes[kMost / 16];
  std::size_t count = 0;
};

/// Appends tiles of sixteen consecutive points each, the last of fewer; tiles whose points are
/// apart (split_rule.h) are split further. Unused slots are far away.
/// @param points  no more than TileBatch::kMost in all; their order changes
void make_tiles(CloudPoint* points, std::size_t n, TileBatch* batch);

/// Fills tiles with sixteen consecutive points each, the last with fewer. Unused slots are far
/// away.
/// @param points  n of them, and kPointSlack more that may be read
/// @returns how many
std::size_t fill_tiles(const CloudPoint* points, std::size_t n, PointTile* tiles);

}  // namespace ist
