#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>

#include "internal/geometry/numbers.h"
#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/filter/command_message.h"

namespace ist {
namespace {

using Twist = Eigen::Matrix<double, 6, 1>;

// Share of the tool's fastest motion: what is slower counts as no motion at all.
constexpr double kSingular = 1e-3;
constexpr double kRounding = 1e-6;  // share of a twist that may be missing

std::string stamp_fault(const ros::Time& stamp, const CommandReader& reader) {
  const double age = seconds_between(stamp, reader.now);
  if (stamp.isZero()) return "the twist has no stamp";
  if (age > reader.timeout) {
    return format_text("the twist's stamp is %.2f s old; ~command_timeout is %g s", age,
                       reader.timeout);
  }
  if (age >= -kMaxAhead) return "";
  return format_text("the twist's stamp is %.2f s ahead of the clock; compare the clocks", -age);
}

// Sets joints and Jacobian; returns a sentence where those are not known.
std::string place(const std::string& tool, const std::string& frame, const CommandReader& reader,
                  JointCommand* command) {
  const Kinematics& kinematics = *reader.kinematics;
  for (const std::string& name : {tool, frame}) {
    if (kinematics.find_body(name)) continue;
    return "the URDF has no link '" + name +
           "'; a twist is of the link ~tool, in the axes of the link in its frame_id";
  }
  std::vector<double> q;
  for (const Kinematics::Joint& joint : kinematics.joints()) q.push_back(reader.q(joint.name));
  JointPoses joints;
  BodyPoses bodies;
  kinematics.place_joints(q, &joints);
  kinematics.place_bodies(joints, Eigen::Isometry3d::Identity(), &bodies);
  const std::size_t moved = *kinematics.find_body(tool), axes = *kinematics.find_body(frame);
  if (!bodies.known[moved] || !bodies.known[axes]) {
    return "the pose of '" + (bodies.known[moved] ? frame : tool) +
           "' does not follow from the joint states";
  }
  Jacobian all;
  point_jacobian(kinematics, bodies.X_FB, moved, bodies.X_FB[moved].translation(), &all);
  command->jacobian.resize(6, 0);
  for (const std::string& name : reader.joints) {
    const auto joint = kinematics.find_joint(name);
    Twist column = Twist::Zero();
    if (joint) column = all.col(static_cast<Eigen::Index>(*joint));
    if (joint && column.isZero(0.0)) continue;  // a name that is not known is told by others
    const Eigen::Matrix3d R_AF = bodies.X_FB[axes].linear().transpose();
    const Eigen::Index last = command->jacobian.cols();
    command->jacobian.conservativeResize(Eigen::NoChange, last + 1);
    command->jacobian.col(last) << R_AF * column.head<3>(), R_AF * column.tail<3>();
    command->joints.push_back(name);
    command->velocity.push_back(kNaN);
  }
  return command->joints.empty()
             ? "no joint moves '" + tool + "'; ~tool names the link that a twist moves"
             : "";
}

}  // namespace

Eigen::VectorXd least_velocity(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& twist) {
  Eigen::JacobiSVD<Eigen::MatrixXd> svd(jacobian, Eigen::ComputeThinU | Eigen::ComputeThinV);
  svd.setThreshold(kSingular);
  return svd.solve(twist);
}

JointCommand read_command(const geometry_msgs::TwistStamped& message, const CommandReader& reader) {
  JointCommand command;
  if (!reader.kinematics) return command;
  Twist twist;
  twist << to_vector(message.twist.linear), to_vector(message.twist.angular);
  const std::string frame = without_slash(message.header.frame_id);
  const std::string tool = reader.tool.empty() ? frame : reader.tool;
  command.fault = place(tool, frame, reader, &command);
  if (command.fault.empty()) command.fault = stamp_fault(message.header.stamp, reader);
  if (command.fault.empty() && !twist.allFinite()) {
    command.fault = "the twist has a value that is not a finite number";
  }
  if (!command.fault.empty()) return command;
  const Eigen::VectorXd velocity = least_velocity(command.jacobian, twist);
  const double missing = (command.jacobian * velocity - twist).stableNorm();
  const double size = twist.stableNorm();
  if (!(missing <= kRounding * size) || !std::isfinite(size)) {
    command.fault = format_text(
        "'%s' cannot move so where it is: %.3g of the twist's %.3g m/s, rad/s are missing",
        tool.c_str(), missing, size);
    return command;
  }
  command.velocity.assign(velocity.data(), velocity.data() + velocity.size());
  return command;
}

JointCommand read_command(const geometry_msgs::Twist& message, const CommandReader& reader) {
  geometry_msgs::TwistStamped stamped;
  stamped.header.frame_id = reader.tool;
  stamped.header.stamp = reader.now;
  stamped.twist = message;
  JointCommand command = read_command(stamped, reader);
  command.keeps_way = true;
  return command;
}

void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf&, geometry_msgs::TwistStamped* message) {
  Twist twist = Twist::Zero();
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    if (velocity[i] != 0.0) {
      twist += velocity[i] * command.jacobian.col(static_cast<Eigen::Index>(i));
    }
  }
  assign(twist.head<3>(), &message->twist.linear);
  assign(twist.tail<3>(), &message->twist.angular);
}

void set_velocity(const JointCommand& command, const std::vector<double>& velocity,
                  const JointPositionOf& q, geometry_msgs::Twist* message) {
  geometry_msgs::TwistStamped stamped;
  set_velocity(command, velocity, q, &stamped);
  *message = stamped.twist;
}

}  // namespace ist
