#pragma once

#include <cstdint>

#include "internal/bvh/box_hierarchy.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

/// A tile's points on both sides of the middle of their box, across its longest side. Boxes are
/// inverted where there are none.
struct TileHalves {
  std::uint32_t low, high;  ///< bit k: slot k
  PaddedBox low_box, high_box;
};

/// @param points  bit k: the point in slot k belongs
/// @param box     of these, at least
TileHalves halve_tile(const PointTile& tile, std::uint32_t points, const PaddedBox& box);

/// Copies the points whose bit is set, in their order; unused slots get no meaning.
void pick_points(const PointTile& from, std::uint32_t points, PointTile* to);

}  // namespace ist
