#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"

/// An example of a reactive controller: an arm goes to goals in joint space, slows down near
/// obstacles and evades them. Its only inputs are `~proximity`, `~speed_scale` and the joint
/// states.
namespace ist::example {

/// The proximity of one link: fields of ist_proximity/LinkProximity.
struct LinkReading {
  std::size_t body = 0;                             ///< of the kinematics: the link
  double lower_bound = 0.0;                         ///< [m]
  Eigen::Vector3d p_LCl = Eigen::Vector3d::Zero();  ///< [m] point_on_link_local; NaN when CLEAR
  /// Direction away from obstacles, in the fixed frame: `repulsion`, of any length. (`direction`
  /// would do as well, but jumps.)
  Eigen::Vector3d away = Eigen::Vector3d::Zero();
};

/// The proximity of all links at one time.
struct Reading {
  bool is_ok = false;        ///< status OK (or DEGRADED: the bounds hold then, too)
  double message_age = 0.0;  ///< [s] now - header.stamp
  double cloud_age = 0.0;    ///< [s] now - cloud_stamp
  double speed_scale = 0.0;  ///< `~speed_scale`: 0 to 1; 0 when it is not known
  std::vector<LinkReading> links;
};

/// Speeds and distances of the control law; every default is safe for the demo arm.
struct DodgeConfig {
  double task_speed = 0.8;  ///< [rad/s] of the joint that has the farthest to go
  double task_gain = 2.5;   ///< [1/s] slows down before the goal
  double reached = 0.03;    ///< [rad] every joint this near to the goal: reached

  double keep_distance = 0.18;  ///< [m] a nearer obstacle makes the link evade it
  double damping = 5.0;         ///< [1/s] speed away (toward) per metre nearer (farther) than that
  double escape_speed = 0.6;    ///< [m/s] largest speed away that is asked for
  double softness = 0.1;        ///< [m] of lever: links that can hardly move are not forced to

  double max_joint_speed = 1.5;  ///< [rad/s, m/s]
  double limit_gain = 5.0;       ///< [1/s] how fast a joint may go per rad (m) to its limit

  double max_message_age = 0.15;  ///< [s] older is not known
  double max_cloud_age = 0.35;    ///< [s]
};

/// The arm, as far as the control law needs it.
struct ControlledArm {
  Kinematics kinematics;
  std::vector<std::size_t> joints;  ///< the commanded ones

  /// @throws std::invalid_argument naming a joint that the URDF lacks or that takes no position
  ControlledArm(const RobotDescription& description, const std::vector<std::string>& joint_names);
};

/// Joint velocities [rad/s, m/s] by commanded joint: toward the goal, and no nearer to obstacles
/// than allowed.
///
/// A velocity damper (Faverjon and Tournassoud 1987) per link: with d its lower bound and n the
/// unit vector of `away`, the witness must move along n at
///   n . J dq >= damping * (keep_distance - d),   at most escape_speed.
/// The result is the velocity that does so, respects the joints' limits, and is nearest to
/// what the task wants; the task's own speed is multiplied by the speed scale (speed and
/// separation). Zero when the surroundings are not known.
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
