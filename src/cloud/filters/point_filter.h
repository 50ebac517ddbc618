#pragma once

#include <cstdint>
#include <functional>

#include "internal/bvh/padded_box.h"
#include "internal/cloud/point_tile.h"

namespace ist {

/// Returns which points of a tile stay out of the index: bit k for slot k. The box is that of the
/// tile's points; unused slots of the tile are undefined.
using PointFilter = std::function<std::uint32_t(const PointTile& tile, const PaddedBox& box)>;

/// Returns whether a PointFilter may drop a point of this box. It is called before the tiles in the
/// box are filtered.
using BoxFilter = std::function<bool(const PaddedBox& box)>;

}  // namespace ist
