#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "cloud/index/point_index_builder.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Tells the robot's own points from obstacles: a point is the robot's when its exact distance to a
/// link of known pose is at most the padding, or when it is inside.
///
/// The points of a tile are first asked for as one sphere: cover spheres of the tree prove it
/// clear of the link, an inner sphere proves it the robot's. Only where both leave it open are the
/// points asked for one by one, and only where that leaves it open, the exact geometry.
/// Keeps its memory. Not thread safe.
class SelfFilter {
 public:
  /// @param robot    links without a known pose, without geometry or with an error claim no point
  /// @param X_FO     frame of the points -> fixed frame
  /// @param padding  [m] >= 0
  void pose(const PosedRobot& robot, const Eigen::Isometry3d& X_FO, double padding);
  /// The robot at one more instant, beside those before.
  void add(const PosedRobot& robot, const Eigen::Isometry3d& X_FO);

  /// False: none of the points in this box is the robot's.
  bool may_drop(const PaddedBox& box) const;

  /// Bit k: the point in slot k is the robot's.
  /// @param box  of the tile's points
  std::uint32_t on_robot(const PointTile& tile, const PaddedBox& box) const;

  /// on_robot() of this filter, which must live as long.
  PointFilter as_filter() const {
    return [this](const PointTile& tile, const PaddedBox& box) { return on_robot(tile, box); };
  }

 private:
  enum class Verdict { kClear, kOnLink, kOpen };

  struct PosedLink {
    const LinkModel* model;
    Eigen::Isometry3d X_LO;    ///< frame of the points -> link frame
    Eigen::Vector3f center_O;  ///< [m] of the link's bounding sphere
    float reach;               ///< [m] bounding sphere and padding
    float slack;               ///< [m] more than what float rounds off
    float clear_beyond;        ///< [m] outer distance that proves a point clear
  };

  static bool is_near(const PosedLink& link, const Eigen::Vector3f& center_O, float radius);
  Verdict ask_tree(const PosedLink& link, const Eigen::Vector3d& center_L, double radius) const;
  bool ask_geometry(const PosedLink& link, const Eigen::Vector3d& p_L) const;
  std::uint32_t on_link(const PosedLink& link, const PointTile& tile,
                        const Eigen::Vector3d& center_O, double radius) const;

  double padding_ = 0.0;
  std::vector<PosedLink> links_;
};

}  // namespace ist
