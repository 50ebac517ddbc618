#include "support/tiles.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "internal/bvh/padded_box.h"

namespace ist::test {

namespace {

/// Adds the tiles below a node.
/// @param outer  [m] the box that its parent has of it
void add_tiles(const PointBvh& bvh, std::int32_t node, const PaddedBox& outer,
               std::vector<PointTile>* tiles) {
  const auto require_inside = [](bool is_inside, const char* what) {
    if (!is_inside) throw std::logic_error(std::string(what) + " lies outside its box");
  };
  const BoxNode& boxes = bvh.nodes()[static_cast<std::size_t>(node)];
  for (int k = 0; k < boxes.count; ++k) {
    const PaddedBox box = box_in(boxes, k);
    require_inside((box.min >= outer.min).all() && (box.max <= outer.max).all(), "a box");
    if (boxes.child[k] >= 0) {
      add_tiles(bvh, boxes.child[k], box, tiles);
      continue;
    }
    const auto i = static_cast<std::size_t>(~boxes.child[k]);
    PointTile scratch;
    const PointTile& tile = tiles->at(i) = bvh.tile(i, &scratch);
    for (int j = 0; j < tile.count; ++j) {
      const Eigen::Array4f p(tile.x[j], tile.y[j], tile.z[j], 0.0F);
      require_inside((p >= box.min).all() && (p <= box.max).all(), "a point");
    }
  }
}

}  // namespace

std::vector<PointTile> tiles_of(const PointBvh& bvh) {
  std::vector<PointTile> tiles(bvh.tile_count());
  if (bvh.root() < 0) return tiles;
  add_tiles(bvh, bvh.root(), bounds_of(bvh.nodes()[static_cast<std::size_t>(bvh.root())]), &tiles);
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
