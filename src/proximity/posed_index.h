#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"
#include "internal/geometry/relative_pose.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// An index of a snapshot and where the link is in its frame O.
template <class Bvh>
struct PosedIndex {
  /// @param pose             X_FO
  /// @param origin_distance  [m] of O from the frame whose pose was given
  PosedIndex(const Bvh& index, std::int32_t source_index, const RigidPose& pose,
             double origin_distance, const Eigen::Isometry3d& X_FL)
      : bvh(&index),
        source(source_index),
        drift(pose.drift),
        drift_lever(2.0 * origin_distance),
        X_FO(pose.X),
        X_OL(relative_pose(X_FO, X_FL)),
        X_LO(X_OL.inverse()) {}

  const Bvh* bvh;
  std::int32_t source;  ///< index of the snapshot among those of the query
  double drift;         ///< of X_FO as it was given, see RigidPose
  double drift_lever;   ///< [m] what adds to the extent in its pose_error()
  Eigen::Isometry3d X_FO, X_OL, X_LO;
};

/// A rotation, row-major, and a translation in float, as traversals have them.
inline void to_row_major(const Eigen::Isometry3d& X, float R[9], float p[3]) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      R[3 * row + column] = static_cast<float>(X.linear()(row, column));
    }
    p[row] = static_cast<float>(X.translation()[row]);
  }
}

using PointObstacles = PosedIndex<PointBvh>;
using BoxObstacles = PosedIndex<BoxBvh>;

/// Names a point, or a box, of an index.
struct ObstacleId {
  std::int32_t tile = 0;
  int lane = 0;

  std::uint32_t key() const {
    return static_cast<std::uint32_t>(tile) * kBoxWidth + static_cast<std::uint32_t>(lane);
  }
};

inline Eigen::Vector3d point_O(const PointBvh& bvh, ObstacleId id) {
  PointTile scratch;
  return bvh.tile(static_cast<std::size_t>(id.tile), &scratch).point(id.lane);
}
inline Eigen::AlignedBox3d box_O(const BoxBvh& bvh, ObstacleId id) {
  return bvh.tiles()[static_cast<std::size_t>(id.tile)].box(id.lane);
}
/// The number that the message, or BoxIndex::build(), gave to an obstacle.
template <class Bvh>
std::uint32_t message_id(const Bvh& bvh, ObstacleId id) {
  typename Bvh::Tile scratch;
  return bvh.tile(static_cast<std::size_t>(id.tile), &scratch).id[id.lane];
}

/// Calls visit(PosedIndex) for the points of a snapshot and then for its boxes, where there are
/// any.
/// @param source  index of the snapshot among those of the query
template <class Visit>
void for_each_index(const CloudSnapshot& cloud, std::int32_t source, const Eigen::Isometry3d& X_FL,
                    const Visit& visit) {
  if (!cloud.index.empty()) {
    const PointBvh& bvh = cloud.index.bvh();
    visit(PointObstacles(bvh, source, {bvh.X_FO(), 0.0}, 0.0, X_FL));
  }
  if (cloud.boxes != nullptr && !cloud.boxes->empty()) {
    const BoxBvh& bvh = cloud.boxes->bvh();
    visit(BoxObstacles(bvh, source, nearest_rigid(cloud.X_FM * Eigen::Translation3d(bvh.origin())),
                       bvh.origin().norm(), X_FL));
  }
}

}  // namespace ist
