#include "ros/filter/command_message.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "internal/geometry/numbers.h"
#include "ros/common/text.h"

namespace ist {
namespace {

std::string size_fault(const char* what, std::size_t count, std::size_t joints) {
  return format_text("the command has %zu %s for %zu joints", count, what, joints);
}

// Looks for what no message may hold.
void check(JointCommand* command) {
  if (!command->fault.empty()) return;
  std::set<std::string> names;
  for (std::size_t i = 0; i < command->joints.size(); ++i) {
    const std::string& joint = command->joints[i];
    if (!names.insert(joint).second) {
      command->fault = "the command names joint '" + joint + "' twice";
    } else if (!std::isfinite(command->velocity[i])) {
      command->fault = "the command's velocity of joint '" + joint + "' is not a finite number";
    }
    if (!command->fault.empty()) return;
  }
  if (names.empty()) command->fault = "the command has no joints";
}

// Takes the velocities, or says that they are not as many as the joints.
void take(const std::vector<double>& velocity, JointCommand* command) {
  if (velocity.size() == command->joints.size()) {
    command->velocity = velocity;
  } else {
    command->fault = size_fault("velocities", velocity.size(), command->joints.size());
  }
  check(command);
}

JointCommand command_of(const std::vector<std::string>& joints) {
  return {joints, std::vector<double>(joints.size(), kNaN), "", {}, false};
}

// The positions that velocities lead to within a time [s]; none where one is not known.
std::vector<double> positions_after(double time, const JointCommand& command,
                                    const std::vector<double>& velocity, const JointPositionOf& q) {
  std::vector<double> positions;
  for (std::size_t i = 0; i < command.joints.size(); ++i) {
    positions.push_back(q(command.joints[i]) + time * velocity[i]);
    if (!std::isfinite(positions.back())) return {};
  }
  return positions;
}

// [rad, m] From where a joint is to a position.
double way(const std::string& joint, double position, const CommandReader& reader) {
  const auto j = reader.kinematics ? reader.kinematics->find_joint(joint) : std::nullopt;
  return j ? reader.kinematics->joints()[*j].way(reader.q(joint), position) : kNaN;
}

}  // namespace

JointCommand read_command(const trajectory_msgs::JointTrajectory& message,
                          const CommandReader& reader) {
  JointCommand command = command_of(message.joint_names);
  if (message.points.size() != 1) {
    command.fault =
        format_text("the trajectory has %zu points; a command for the next period has one",
                    message.points.size());
    return command;
  }
  const trajectory_msgs::JointTrajectoryPoint& point = message.points[0];
  if (!point.velocities.empty() || point.positions.empty()) {
    take(point.velocities, &command);
    return command;
  }
  const double time = point.time_from_start.toSec();
  if (point.positions.size() != command.joints.size()) {
    command.fault = size_fault("positions", point.positions.size(), command.joints.size());
  } else if (!(time > 0.0)) {
    command.fault = format_text(
        "the trajectory has positions only, to be reached after %g s; with a "
        "time_from_start above 0, velocities follow from them",
        time);
  } else {
    for (std::size_t i = 0; i < command.joints.size(); ++i) {
      command.velocity[i] = way(command.joints[i], point.positions[i], reader) / time;
    }
  }
  check(&command);
  return command;
}

JointCommand read_command(const sensor_msgs::JointState& message, const CommandReader&) {
  JointCommand command = command_of(message.name);
  take(message.velocity, &command);
  return command;
}

JointCommand read_command(const std_msgs::Float64MultiArray& message, const CommandReader& reader) {
  JointCommand command = command_of(reader.joints);
  const std::size_t offset = message.layout.data_offset;
  if (offset > message.data.size()) {
    command.fault = format_text("the command's data_offset is %zu, and it has %zu numbers", offset,
                                message.data.size());
    return command;
  }
  const auto first = message.data.begin() + static_cast<std::ptrdiff_t>(offset);
  take(std::vector<double>(first, message.data.end()), &command);
  return command;
}

void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, trajectory_msgs::JointTrajectory* message) {
  const bool has_point = !message->points.empty();
  message->points.resize(1);
  trajectory_msgs::JointTrajectoryPoint& point = message->points[0];
  if (!has_point) point = trajectory_msgs::JointTrajectoryPoint();
  point.velocities = velocity;
  point.accelerations.clear();
  point.effort.clear();
  if (!point.positions.empty()) {
    point.positions =
        positions_after(std::max(point.time_from_start.toSec(), 0.0), command, velocity, q);
  }
}

void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, sensor_msgs::JointState* message) {
  message->velocity = velocity;
  message->effort.clear();
  if (!message->position.empty()) message->position = positions_after(0.0, command, velocity, q);
}

void set_velocity(const JointCommand&, const std::vector<double>& velocity, const JointPositionOf&,
                  std_msgs::Float64MultiArray* message) {
  message->layout.data_offset = 0;
  message->data = velocity;
}

}  // namespace ist
