#pragma once

#include <ros/time.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <functional>
#include <string>
#include <vector>

#include "ist_proximity/proximity/joint_trajectory.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// [rad, m] The present position of a joint, by name; NaN where it is not known.
using PresentPosition = std::function<double(const std::string& joint)>;

/// A trajectory that a controller follows, as the library takes it.
struct WatchedTrajectory {
  ros::Time start;                  ///< when its time 0 is
  std::vector<std::size_t> joints;  ///< those that it moves, by joint of the kinematics
  StraightPieces pieces;

  double end() const { return pieces.times.back(); }  ///< [s]
  /// [rad, m] By joint of the kinematics, at a time [s]; NaN for joints that it does not move.
  std::vector<double> positions(double time) const;
  /// The same, of the joints that it moves, as a message.
  sensor_msgs::JointState state(const Kinematics& kinematics, double time) const;
  /// [s] The latest time at which braking along the trajectory still ends before `contact`; `from`
  /// where that is past. Braking slows time down steadily, as fast as every joint can with its
  /// deceleration [rad/s^2, m/s^2] beside what the trajectory asks of it.
  /// @param decelerations  by joint of the kinematics
  double latest_brake(double from, double contact, const std::vector<double>& decelerations) const;
};

/// Reads a message with one point or more. Where its first point is not at time 0, the trajectory
/// begins at the joints' present positions, as controllers do.
/// @param received  its start, where its stamp is 0
/// @returns empty, or a sentence: why it cannot be watched
std::string read_trajectory(const trajectory_msgs::JointTrajectory& message,
                            const Kinematics& kinematics, const PresentPosition& present,
                            const ros::Time& received, WatchedTrajectory* trajectory);

}  // namespace ist
