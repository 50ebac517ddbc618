#pragma once

#include <cstdint>

#include "internal/bvh/padded_box.h"
#include "internal/cloud/point_tile.h"

namespace ist {

/// Some points of a tile, split in the middle of the longest side of their box. A box is inverted
/// where its half has no point.
struct TileHalves {
  std::uint32_t low, high;  ///< bit k: slot k
  PaddedBox low_box, high_box;
};

/// @param points  bit k: the point in slot k is one of them
/// @param box     of these, at least
TileHalves halve_tile(const PointTile& tile, std::uint32_t points, const PaddedBox& box);

/// Copies the points whose bit is set, in their order; unused slots are left as they are.
void pick_points(const PointTile& from, std::uint32_t points, PointTile* to);

}  // namespace ist
