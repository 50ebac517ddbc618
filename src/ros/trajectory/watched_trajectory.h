#pragma once

#include <ros/time.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "ist_proximity/proximity/joint_trajectory.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// A joint's position and velocity now; NaN where they are not known.
struct JointMotionNow {
  double q, dq;  ///< [rad, m], [rad/s, m/s]
};
using PresentMotion = std::function<JointMotionNow(const std::string& joint)>;

/// A trajectory that a controller follows, as the library takes it.
struct WatchedTrajectory {
  ros::Time start;                  ///< when its time 0 is
  std::vector<std::size_t> joints;  ///< those that it moves, by joint of the kinematics
  StraightPieces pieces;

  double end() const { return pieces.times.back(); }  ///< [s]
  /// When its time [s] is; 0 where that is before the clock's beginning.
  ros::Time instant(double time) const { return ros::Time(std::max(0.0, start.toSec() + time)); }
  /// The positions of the joints that it moves, at a time [s].
  sensor_msgs::JointState state(const Kinematics& kinematics, double time) const;
};

/// Reads a message with one point or more. Where its first point is not at time 0, the trajectory
/// begins at the joints' present positions and velocities, as controllers do: they leave out whole
/// turns of continuous joints. A velocity that is not known is 0.
/// @param received  its start, where its stamp is 0
/// @returns empty, or a sentence: why it cannot be watched
std::string read_trajectory(const trajectory_msgs::JointTrajectory& message,
                            const Kinematics& kinematics, const PresentMotion& present,
                            const ros::Time& received, WatchedTrajectory* trajectory);

}  // namespace ist
