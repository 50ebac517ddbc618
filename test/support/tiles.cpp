#include "support/tiles.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace ist::test {

std::vector<PointTile> tiles_of(const PointBvh& bvh) {
  std::vector<PointTile> tiles(bvh.tile_count());
  PointTile scratch;
  for (std::size_t i = 0; i < tiles.size(); ++i) tiles[i] = bvh.tile(i, &scratch);
  return tiles;
}

std::vector<PointTile> tiles_of(const PointIndex& index) { return tiles_of(index.bvh()); }

std::map<std::uint32_t, Eigen::Vector3d> points_by_id(const PointIndex& index) {
  std::map<std::uint32_t, Eigen::Vector3d> points;
  for (const PointTile& tile : tiles_of(index)) {
    for (int k = 0; k < tile.count; ++k) {
      if (!points.emplace(tile.id[k], index.X_FO() * tile.point(k)).second) {
        throw std::logic_error("point " + std::to_string(tile.id[k]) + " is there twice");
      }
    }
  }
  return points;
}

std::set<std::uint32_t> ids_of(const PointIndex& index) {
  std::set<std::uint32_t> ids;
  for (const auto& [id, p_F] : points_by_id(index)) ids.insert(ids.end(), id);
  return ids;
}

std::vector<ThinnedTile> thinned_tiles_of(const PointIndex& index) {
  const ThinnedCloud cloud = index.bvh().thinned();
  std::vector<ThinnedTile> all;
  if (cloud.empty()) return all;
  ThinnedNode buffer;
  for (std::size_t i = 0; i < cloud.nodes().size(); ++i) {
    if (!ThinnedCloud::is_leaf(cloud.nodes()[i])) continue;
    const auto tiles = cloud.tiles(static_cast<std::int32_t>(i), &buffer);
    all.insert(all.end(), tiles.begin(), tiles.end());
  }
  return all;
}

std::map<std::uint32_t, Eigen::Vector3d> thinned_points_of(const PointIndex& index) {
  std::map<std::uint32_t, Eigen::Vector3d> points;
  for (const ThinnedTile& tile : thinned_tiles_of(index)) {
    for (int k = 0; k < tile.count; ++k) points[tile.id[k]] = index.X_FO() * tile.point(k);
  }
  return points;
}

bool same_points(const PointTile& a, const PointTile& b) {
  return a.count == b.count && std::equal(a.x, a.x + kPointWidth, b.x) &&
         std::equal(a.y, a.y + kPointWidth, b.y) && std::equal(a.z, a.z + kPointWidth, b.z) &&
         std::equal(a.id, a.id + kPointWidth, b.id);
}

}  // namespace ist::test
