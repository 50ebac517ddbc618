#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "internal/cloud/point_bvh.h"

namespace ist::test {

/// All tiles of an index, whether a query has looked at them or not.
/// @throws std::logic_error where a point or a box lies outside its box: a search would prune it
std::vector<PointTile> tiles_of(const PointBvh& bvh);
std::vector<PointTile> tiles_of(const PointIndex& index);

/// The points of an index in the fixed frame [m], by their ids, and the ids.
/// @throws std::logic_error where an id is there twice
std::map<std::uint32_t, Eigen::Vector3d> points_by_id(const PointIndex& index);
std::set<std::uint32_t> ids_of(const PointIndex& index);

/// All tiles of a thinned cloud, whether a query has looked at them or not.
std::vector<ThinnedTile> thinned_tiles_of(const PointIndex& index);

/// The points of the thinned cloud in the fixed frame [m], by their ids.
std::map<std::uint32_t, Eigen::Vector3d> thinned_points_of(const PointIndex& index);

bool same_points(const PointTile& a, const PointTile& b);

}  // namespace ist::test
