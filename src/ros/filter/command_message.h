#pragma once

#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <functional>
#include <string>
#include <vector>

namespace ist {

/// [rad, m] The present position of a joint, by name; NaN where it is not known.
using JointPositionOf = std::function<double(const std::string& joint)>;

/// The velocities [rad/s, m/s] that a message commands.
struct JointCommand {
  std::vector<std::string> joints;  ///< by name, in the message's order
  std::vector<double> velocity;  ///< by joint; NaN where the message states none that can be used
  std::string fault;             ///< a sentence: why it cannot be used; empty: it can
};

/// Reads a command. A trajectory has one point, with velocities, or with positions, which are to be
/// reached after its time_from_start.
/// @param names  the joints of a message that names none; else not read
JointCommand read_command(const trajectory_msgs::JointTrajectory& message,
                          const std::vector<std::string>& names, const JointPositionOf& q);
JointCommand read_command(const sensor_msgs::JointState& message,
                          const std::vector<std::string>& names, const JointPositionOf& q);
JointCommand read_command(const std_msgs::Float64MultiArray& message,
                          const std::vector<std::string>& names, const JointPositionOf& q);

/// Puts velocities into a command in place of its own. Positions become where these lead to, and
/// accelerations and efforts go.
/// @param velocity  by joint of the command
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, trajectory_msgs::JointTrajectory* message);
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, sensor_msgs::JointState* message);
void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, std_msgs::Float64MultiArray* message);

}  // namespace ist
