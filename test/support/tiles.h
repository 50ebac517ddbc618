#pragma once

#include <algorithm>
#include <vector>

#include "ist_proximity/cloud/point_index.h"

namespace ist::test {

/// All tiles of an index, whether a query has looked at them or not.
inline std::vector<PointTile> tiles_of(const PointIndex& index) {
  std::vector<PointTile> tiles(index.tile_count());
  PointTile room;
  for (std::size_t i = 0; i < tiles.size(); ++i) tiles[i] = index.tile(i, &room);
  return tiles;
}

inline bool same_points(const PointTile& a, const PointTile& b) {
  return a.count == b.count && std::equal(a.x, a.x + kPointWidth, b.x) &&
         std::equal(a.y, a.y + kPointWidth, b.y) && std::equal(a.z, a.z + kPointWidth, b.z) &&
         std::equal(a.id, a.id + kPointWidth, b.id);
}

}  // namespace ist::test
