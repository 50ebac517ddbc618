#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_description.h"

namespace ist::sim {

struct ArmConfig {
  /// Joints that take velocity commands, revolute or prismatic; the others stay at `rest`.
  std::vector<std::string> joints;
  double max_velocity = 1.5;       ///< [rad/s, m/s] of each commanded joint
  double max_acceleration = 10.0;  ///< [rad/s^2, m/s^2]
  double rest = 0.0;               ///< [rad, m] position of joints without command
};

/// A kinematic arm. Its joints follow velocity commands as fast as the limits of velocity and
/// acceleration allow, and stop at the URDF's position limits.
class Arm {
 public:
  /// @throws std::invalid_argument naming a joint that the URDF lacks or that takes no position
  Arm(const RobotDescription& description, const ArmConfig& config);

  /// Puts the arm at rest in a position.
  /// @param q  [rad, m] by commanded joint
  void reset(const Eigen::VectorXd& q);
  /// Follows a velocity command for one step.
  /// @param command  [rad/s, m/s] by commanded joint; finite
  /// @param dt       [s]
  void step(const Eigen::VectorXd& command, double dt);

  const Eigen::VectorXd& positions() const { return q_; }        ///< by commanded joint
  const Eigen::VectorXd& velocities() const { return dq_; }      ///< by commanded joint
  const Eigen::VectorXd& accelerations() const { return ddq_; }  ///< in the last step
  /// Positions by joint of the kinematics; NaN where a joint has no position of its own.
  std::vector<double> all_positions(const Eigen::VectorXd& q) const;

  const Kinematics& kinematics() const { return kinematics_; }
  const ArmConfig& config() const { return config_; }
  const std::vector<std::size_t>& joints() const { return joints_; }  ///< commanded ones

  /// Poses of the description's links (those with geometry), root link -> fixed frame = identity.
  std::vector<Eigen::Isometry3d> link_poses(const Eigen::VectorXd& q) const;
  /// Whether a commanded joint moves a link, by link of the description.
  const std::vector<bool>& moved() const { return moved_; }

 private:
  Kinematics kinematics_;
  ArmConfig config_;
  std::vector<std::size_t> joints_;  ///< commanded ones
  std::vector<std::size_t> bodies_;  ///< by link of the description
  std::vector<bool> moved_;
  Eigen::VectorXd q_, dq_, ddq_;
};

}  // namespace ist::sim
