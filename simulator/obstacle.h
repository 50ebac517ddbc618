#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <string>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/geometry/solid.h"

namespace ist::sim {

/// A sphere or a box that stands still, moves along a straight line at constant speed, or follows a
/// path.
struct Obstacle {
  std::string name;
  Shape shape;  ///< Sphere or Box
  Eigen::Matrix3d R_FO = Eigen::Matrix3d::Identity();
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();  ///< [m] its centre
  double start = 0.0;   ///< [s] when the motion from `from` begins; it ends at `to`
  double speed = 0.0;   ///< [m/s] 0: it stays at `from`
  double repeat = 0.0;  ///< [s] > 0: after this time it moves back, then forth again, and so on

  /// The centre [m] at a time [s], if set: it replaces the line.
  std::function<Eigen::Vector3d(double)> path;

  bool is_fixed() const { return speed == 0.0 && !path; }
  Eigen::Isometry3d pose(double time) const;  ///< X_FO at `time` [s]
  double radius() const;                      ///< [m] of the bounding sphere about its centre
};

/// The exact distance [m] of a solid and an obstacle, if less than `max_distance`, else inf; 0 or
/// negative where they touch or overlap.
double distance(const Solid& solid, const Eigen::Isometry3d& X_FL, const Obstacle& obstacle,
                const Eigen::Isometry3d& X_FO, double max_distance);

}  // namespace ist::sim
