#pragma once

#include <geometry_msgs/Twist.h>
#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// [rad, m] The present position of a joint, by name; NaN where it is not known.
using JointPositionOf = std::function<double(const std::string& joint)>;

/// The velocities [rad/s, m/s] that a message commands.
struct JointCommand {
  std::vector<std::string> joints;  ///< by name, in the message's order
  std::vector<double> velocity;  ///< by joint; NaN where the message states none that can be used
  std::string fault;             ///< a sentence: why it cannot be used; empty: it can
  /// The tool's linear [m/s] over angular velocity [rad/s] in a twist's frame, by joint. Empty
  /// where the command is no twist.
  Eigen::MatrixXd jacobian;
  bool keeps_way = false;  ///< it may be slowed down, and not be turned
};

/// All that commands are read with, besides the message.
struct CommandReader {
  std::vector<std::string> joints;  ///< of a message that names none
  JointPositionOf q;
  std::shared_ptr<const Kinematics> kinematics;  ///< null: not known yet, and no twist is read
  // The rest is read for twists alone.
  std::string tool;  ///< link that a twist moves; empty: its frame
  ros::Time now;
  double timeout;  ///< [s] oldest twist that still counts
};

/// Reads a command. A trajectory has one point, with velocities, or with positions, which are to be
/// reached after its time_from_start.
JointCommand read_command(const trajectory_msgs::JointTrajectory& message,
                          const CommandReader& reader);
JointCommand read_command(const sensor_msgs::JointState& message, const CommandReader& reader);
JointCommand read_command(const std_msgs::Float64MultiArray& message, const CommandReader& reader);
/// A twist is that of the tool's origin, in the axes of header.frame_id. Its velocities are the
/// least ones (by their sum of squares) that move the tool so, of those joints of the reader that
/// move it. A twist that the tool cannot make where it is, to a thousandth of its fastest one, is a
/// fault.
JointCommand read_command(const geometry_msgs::TwistStamped& message, const CommandReader& reader);

/// The twist is that of the tool in its own axes, as a mobile base takes it; it keeps its way.
JointCommand read_command(const geometry_msgs::Twist& message, const CommandReader& reader);

/// The least velocities [rad/s, m/s] that make a twist.
/// @param jacobian  JointCommand::jacobian, not empty
Eigen::VectorXd least_velocity(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& twist);

/// Puts velocities into a command in place of its own. Positions become where these lead to, and
/// accelerations and efforts go.
/// @param velocity  by joint of the command
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, trajectory_msgs::JointTrajectory* message);
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, sensor_msgs::JointState* message);
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, std_msgs::Float64MultiArray* message);
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, geometry_msgs::TwistStamped* message);
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, geometry_msgs::Twist* message);

}  // namespace ist
