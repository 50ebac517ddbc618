#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "ist_proximity/cloud/seen_space.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// How much of a link's surroundings has been seen.
struct SeenShare {
  double share = std::numeric_limits<double>::quiet_NaN();  ///< 0 to 1; NaN: not known
  /// [s] Age of what was seen longest ago; NaN: nothing was seen.
  double age = std::numeric_limits<double>::quiet_NaN();
};

/// The surroundings of a link, as points on a grid in its frame that are farther from the link than
/// a skin and no farther than a distance. Immutable, thread safe.
class Surroundings {
 public:
  /// @param skin, distance  [m] skin < distance
  Surroundings(const LinkModel& link, double skin, double distance);

  /// @param X_ML  link frame -> frame of `seen`
  /// @param now   [s] from which ages count
  SeenShare look(const SeenSpace& seen, const Eigen::Isometry3d& X_ML, double now) const;

  std::size_t size() const { return points_.size(); }

 private:
  std::vector<Eigen::Vector3d> points_;  ///< [m] in the link's frame
};

}  // namespace ist
