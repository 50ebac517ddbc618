#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"

/// An example of a reactive controller: an arm moves to goals in joint space, slows down near
/// obstacles and evades them. Its only inputs are `~proximity` and the joint states.
namespace ist::example {

/// The proximity of one link, from the fields of ist_proximity/LinkProximity.
struct LinkReading {
  std::size_t link = 0;                             ///< index in the kinematics
  double lower_bound = 0.0;                         ///< [m]
  Eigen::Vector3d p_LCl = Eigen::Vector3d::Zero();  ///< [m] point_on_link_local; NaN when CLEAR
  /// Direction of escape in the fixed frame, of any length: `repulsion`. (`direction` works as
  /// well, but is not continuous.)
  Eigen::Vector3d away = Eigen::Vector3d::Zero();
};

/// The proximity of all links.
struct Reading {
  bool is_ok = false;        ///< status OK (or DEGRADED, whose bounds hold too)
  double message_age = 0.0;  ///< [s] now - header.stamp
  double cloud_age = 0.0;    ///< [s] now - cloud_stamp
  std::vector<LinkReading> links;
};

/// Speeds and distances of the control law; every default is safe for the demo arm.
struct DodgeConfig {
  double task_speed = 0.8;  ///< [rad/s] of the joint that is farthest from its goal
  double task_gain = 2.5;   ///< [1/s] speed per distance to the goal, close to it
  double reached = 0.03;    ///< [rad] largest error of a joint at a goal that counts as reached

  double slow_distance = 0.25;  ///< [m] the task slows down below this distance ...
  double stop_distance = 0.10;  ///< [m] ... and stands still below this one

  double keep_distance = 0.18;  ///< [m] links evade obstacles that are nearer
  double damping = 5.0;         ///< [1/s] speed away (toward) per metre below (above) that distance
  double escape_speed = 0.6;    ///< [m/s] largest speed of evasion
  double softness = 0.1;        ///< [m] of lever: links that can hardly move are not forced to

  double max_joint_speed = 1.5;  ///< [rad/s, m/s]
  double limit_gain = 5.0;       ///< [1/s] largest speed per rad (m) of distance to a joint limit

  double max_message_age = 0.15;  ///< [s] older messages count as unknown
  double max_cloud_age = 0.35;    ///< [s] older clouds count as unknown
};

/// The kinematics of the arm and its commanded joints.
struct ControlledArm {
  Kinematics kinematics;
  std::vector<std::size_t> joints;  ///< commanded joints

  /// @throws std::invalid_argument naming a joint that the URDF lacks or that takes no position
  ControlledArm(const RobotDescription& description, const std::vector<std::string>& joint_names);
};

/// Joint velocities [rad/s, m/s] by commanded joint that approach the goal and evade obstacles.
///
/// Each link has a velocity damper (Faverjon and Tournassoud 1987): with d its lower bound and n
/// the unit vector of `away`, the witness point must move along n at
///   n . J dq >= damping * (keep_distance - d),   at most escape_speed.
/// The result is the velocity nearest to the task's velocity that satisfies these constraints and
/// the joints' limits. The smallest lower bound slows down the task itself (speed and separation
/// monitoring). The result is zero when the reading may not be acted upon, see is_known.
/// @param q     [rad, m] by joint of the kinematics (NaN where a joint has none)
/// @param goal  [rad, m] by commanded joint
/// Pure; thread safe.
Eigen::VectorXd dodge(const ControlledArm& arm, const std::vector<double>& q,
                      const Eigen::VectorXd& goal, const Reading& reading,
                      const DodgeConfig& config);

/// Whether the reading may be acted upon: fresh, OK, and every link known.
bool is_known(const Reading& reading, const DodgeConfig& config);

/// Whether every commanded joint is at the goal.
bool has_reached(const ControlledArm& arm, const std::vector<double>& q,
                 const Eigen::VectorXd& goal, const DodgeConfig& config);

}  // namespace ist::example
