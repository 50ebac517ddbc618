#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "cloud/filters/point_filter.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Separates the robot's own points from obstacles: a point is the robot's when its exact distance
/// to a link is at most the padding, or when it is inside the link.
///
/// The points of a tile are first tested as one sphere: the tree's cover spheres prove that it is
/// clear of the link, an inner sphere proves that it is the robot's. The points are tested one by
/// one only where both leave it open, and against the exact geometry only where that leaves it
/// open, too. Keeps its memory. Not thread safe.
class SelfFilter {
 public:
  /// @param solids   the robot's links, at one or several instants; viewed until the next call. A
  ///                 point is compared with those that it was measured at
  /// @param X_FO     frame of the points -> fixed frame
  /// @param padding  [m] >= 0
  void set_poses(Span<const PosedSolid> solids, const Eigen::Isometry3d& X_FO, double padding);

  /// False: none of the points in this box is the robot's.
  bool may_drop(const PaddedBox& box) const;

  /// Bit k: the point in slot k is the robot's.
  /// @param box  of the tile's points
  std::uint32_t points_on_robot(const PointTile& tile, const PaddedBox& box) const;

  /// points_on_robot() of this filter, which must outlive the result.
  PointFilter as_filter() const {
    return
        [this](const PointTile& tile, const PaddedBox& box) { return points_on_robot(tile, box); };
  }

 private:
  enum class Verdict { kClear, kOnLink, kUndecided };

  struct Link {
    const InnerSphereTree* tree;
    const Solid* solid;
    Eigen::Isometry3d X_LO;                 ///< frame of the points -> link frame
    Eigen::Vector3f center_O;               ///< [m] of the link's bounding sphere
    float padded_radius;                    ///< [m] of the bounding sphere, and the clear distance
    float rounding;                         ///< [m] more than what float rounds off
    float clear_distance;                   ///< [m] a cover distance above it proves a point clear
    std::uint32_t first_point, last_point;  ///< ids of the points that the pose is for
  };

  static bool may_touch(const Link& link, const Eigen::Vector3f& center_O, float radius);
  Verdict test_spheres(const Link& link, const Eigen::Vector3d& center_L, double radius) const;
  bool test_geometry(const Link& link, const Eigen::Vector3d& p_L) const;
  std::uint32_t points_on_link(const Link& link, const PointTile& tile, std::uint32_t measured,
                               const Eigen::Vector3d& center_O, double radius) const;

  double padding_ = 0.0;
  std::vector<Link> links_;
};

}  // namespace ist
