#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "hard_cases/scene.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist::benchmark {

/// The demo arm with its kinematics. Immutable.
class DemoMotion {
 public:
  DemoMotion();

  const RobotDescription& robot() const { return robot_; }

  /// X_FL by link; the root link's frame is the fixed frame.
  /// @param q  [rad] by free joint in the order of the URDF; joints that q lacks are at zero
  Poses poses(const std::vector<double>& q) const;

  /// The extent [m] of the links for which `is_wanted` is true.
  Eigen::AlignedBox3d extent(const Poses& X_FL,
                             const std::function<bool(const std::string&)>& is_wanted) const;

 private:
  RobotDescription robot_;
  Kinematics kinematics_;
  std::vector<std::size_t> bodies_;  // by link: its body
};

}  // namespace ist::benchmark
