// The example controller as a node. Its only inputs are the proximity node's ~proximity and
// ~speed_scale, and the joint states.
//
//   proximity     subscribed, ist_proximity/ProximityArray; its fixed frame is the root link
//   speed_scale   subscribed, std_msgs/Float64: the task's speed is multiplied by it
//   joint_states  subscribed, sensor_msgs/JointState
//   joint_velocity_controller/command
//                 published, std_msgs/Float64MultiArray [rad/s], by ~joints; with each
//                 ProximityArray
//   ~state        published, std_msgs/String, with each command: moving, with the link that
//                 approaches or touches an obstacle (time_to_contact, closing_speed and penetration
//                 of the message); or the reason for standing still
//   ~goals        published, std_msgs/UInt32, latched: the number of goals reached
//
// Parameters: ~joints (names), ~goals (a list of joint positions, visited in turn), and the members
// of DodgeConfig by name.

#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_msgs/String.h>
#include <std_msgs/UInt32.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "dodge_controller.h"
#include "ist_proximity/ProximityArray.h"

namespace ist::example {
namespace {

using ist_proximity::ProximityArray;

DodgeConfig read_config(const ros::NodeHandle& nh) {
  constexpr struct {
    const char* name;
    double DodgeConfig::*value;
  } kParameters[] = {{"task_speed", &DodgeConfig::task_speed},
                     {"task_gain", &DodgeConfig::task_gain},
                     {"reached", &DodgeConfig::reached},
                     {"keep_distance", &DodgeConfig::keep_distance},
                     {"damping", &DodgeConfig::damping},
                     {"escape_speed", &DodgeConfig::escape_speed},
                     {"softness", &DodgeConfig::softness},
                     {"max_joint_speed", &DodgeConfig::max_joint_speed},
                     {"limit_gain", &DodgeConfig::limit_gain},
                     {"max_message_age", &DodgeConfig::max_message_age},
                     {"max_cloud_age", &DodgeConfig::max_cloud_age}};
  DodgeConfig config;
  for (const auto& parameter : kParameters) {
    double& value = config.*parameter.value;
    value = nh.param(parameter.name, value);
    if (!(value > 0.0)) {
      throw std::runtime_error(std::string("~") + parameter.name + " must be a number above 0.");
    }
  }
  return config;
}

std::vector<Eigen::VectorXd> read_goals(const ros::NodeHandle& nh, std::size_t joints) {
  XmlRpc::XmlRpcValue list;
  std::vector<Eigen::VectorXd> goals;
  const std::string wanted =
      "~goals must be a list of lists of " + std::to_string(joints) + " joint positions.";
  if (!nh.getParam("goals", list) || list.getType() != XmlRpc::XmlRpcValue::TypeArray) {
    throw std::runtime_error(wanted);
  }
  for (int i = 0; i < list.size(); ++i) {
    XmlRpc::XmlRpcValue& one = list[i];
    if (one.getType() != XmlRpc::XmlRpcValue::TypeArray || one.size() != static_cast<int>(joints)) {
      throw std::runtime_error(wanted);
    }
    Eigen::VectorXd goal(one.size());
    for (int j = 0; j < one.size(); ++j) {
      const bool is_int = one[j].getType() == XmlRpc::XmlRpcValue::TypeInt;
      if (!is_int && one[j].getType() != XmlRpc::XmlRpcValue::TypeDouble) {
        throw std::runtime_error(wanted);
      }
      goal[j] = is_int ? static_cast<int>(one[j]) : static_cast<double>(one[j]);
    }
    goals.push_back(goal);
  }
  if (goals.empty()) throw std::runtime_error(wanted);
  return goals;
}

RobotDescription read_robot(const ros::NodeHandle& nh) {
  std::string urdf;
  if (!nh.getParam("robot_description", urdf)) {
    throw std::runtime_error("the parameter robot_description is not set.");
  }
  return parse_urdf(urdf, GeometrySource::kCollision, environment_package_finder());
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  return text;
}

// Describes the link that will be in contact first, as the message estimates it, or the force on a
// link in contact. This is for people to read; the control law uses the proven bounds.
std::string describe(const ProximityArray& message) {
  const ist_proximity::LinkProximity* first = nullptr;
  std::string contacts;
  for (const ist_proximity::LinkProximity& link : message.links) {
    if (link.state == ist_proximity::LinkProximity::CONTACT) {
      const auto& f = link.penetration.force;  // NaN until the link's volume is packed
      const double force = Eigen::Vector3d(f.x, f.y, f.z).norm();
      contacts += "; " + link.link + " is in contact";
      if (std::isfinite(force)) contacts += ", pressed by " + number(force) + " N";
    }
    if (!std::isfinite(link.time_to_contact)) continue;  // not approaching, or unknown
    if (!first || link.time_to_contact < first->time_to_contact) first = &link;
  }
  if (!first || !contacts.empty()) return contacts;
  return "; " + first->link + " would touch in " + number(first->time_to_contact) +
         " s, nearing at " + number(first->closing_speed) + " m/s";
}

}  // namespace

class DodgeNode {
 public:
  DodgeNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
      : DodgeNode(nh, private_nh, read_robot(nh)) {}

 private:
  DodgeNode(ros::NodeHandle nh, ros::NodeHandle private_nh, const RobotDescription& robot)
      : config_(read_config(private_nh)),
        root_(robot.root_link),
        arm_(robot, private_nh.param("joints", std::vector<std::string>())),
        goals_(read_goals(private_nh, arm_.joints.size())),
        q_(arm_.kinematics.joints().size(), std::numeric_limits<double>::quiet_NaN()) {
    command_ = nh.advertise<std_msgs::Float64MultiArray>("joint_velocity_controller/command", 1);
    state_ = private_nh.advertise<std_msgs::String>("state", 10);
    reached_ = private_nh.advertise<std_msgs::UInt32>("goals", 1, true);
    const auto no_delay = ros::TransportHints().tcpNoDelay();
    joints_ = nh.subscribe("joint_states", 10, &DodgeNode::on_joints, this, no_delay);
    proximity_ = nh.subscribe("proximity", 1, &DodgeNode::on_proximity, this, no_delay);
    scale_ = nh.subscribe("speed_scale", 1, &DodgeNode::on_speed_scale, this, no_delay);
    // The timer commands a stop when messages cease.
    timer_ = nh.createWallTimer(ros::WallDuration(0.05), &DodgeNode::on_timer, this);
  }

  void on_joints(const sensor_msgs::JointState& message) {
    if (message.name.size() != message.position.size()) return;
    for (std::size_t i = 0; i < message.name.size(); ++i) {
      const auto joint = arm_.kinematics.find_joint(message.name[i]);
      if (joint) q_[*joint] = message.position[i];
    }
    joint_stamp_ = message.header.stamp;
  }

  void on_proximity(const ProximityArray& message) {
    stamp_ = message.header.stamp;
    cloud_stamp_ = message.cloud_stamp;
    problem_ = message.status_text;
    description_ = describe(message);
    reading_ = Reading();
    reading_.is_ok =
        message.status == ProximityArray::OK || message.status == ProximityArray::DEGRADED;
    if (message.header.frame_id != root_) {
      reading_.is_ok = false;
      problem_ = "~proximity is in frame '" + message.header.frame_id + "', not in '" + root_ + "'";
    }
    for (const ist_proximity::LinkProximity& one : message.links) {
      const auto body = arm_.kinematics.find_body(one.link);
      if (!body) continue;
      LinkReading reading;
      reading.body = *body;
      reading.lower_bound = one.lower_bound;
      const auto& p = one.point_on_link_local;
      const auto& r = one.repulsion;
      reading.p_LCl = {p.x, p.y, p.z};
      reading.away = {r.x, r.y, r.z};
      reading_.links.push_back(reading);
    }
    act();
  }

  void on_speed_scale(const std_msgs::Float64& message) {
    speed_scale_ = message.data;
    scale_time_ = ros::Time::now();
  }

  void on_timer(const ros::WallTimerEvent& /*event*/) {
    if ((ros::Time::now() - stamp_).toSec() > 0.5 * config_.max_message_age) act();
  }

  void act() {
    const ros::Time now = ros::Time::now();
    reading_.message_age = stamp_.isZero() ? std::numeric_limits<double>::infinity()
                                           : (now - std::min(stamp_, joint_stamp_)).toSec();
    reading_.cloud_age = (now - cloud_stamp_).toSec();
    // The scale has no stamp: one that has not come of late is not known.
    const bool has_scale = !scale_time_.isZero() && now >= scale_time_ &&
                           (now - scale_time_).toSec() <= config_.max_message_age;
    reading_.speed_scale = has_scale ? speed_scale_ : 0.0;
    if (has_reached(arm_, q_, goals_[goal_], config_)) {
      goal_ = (goal_ + 1) % goals_.size();
      ++count_.data;
      reached_.publish(count_);
    }
    const Eigen::VectorXd dq = dodge(arm_, q_, goals_[goal_], reading_, config_);
    std_msgs::Float64MultiArray command;
    command.data.assign(dq.data(), dq.data() + dq.size());
    command_.publish(command);

    std_msgs::String state;
    if (is_known(reading_, config_)) {
      state.data = "moving" + description_;
    } else if (reading_.message_age > config_.max_message_age) {
      state.data = "stopped: no message of late";
    } else {
      state.data = "stopped: " + (problem_.empty() ? "the cloud is too old" : problem_);
    }
    state_.publish(state);
  }

  DodgeConfig config_;
  std::string root_;
  ControlledArm arm_;
  std::vector<Eigen::VectorXd> goals_;
  std::size_t goal_ = 0;
  std::vector<double> q_;  // by joint of the kinematics
  Reading reading_;
  std::string problem_, description_;
  double speed_scale_ = 0.0;
  ros::Time stamp_, joint_stamp_, cloud_stamp_, scale_time_;
  std_msgs::UInt32 count_;
  ros::Publisher command_, state_, reached_;
  ros::Subscriber joints_, proximity_, scale_;
  ros::WallTimer timer_;
};

}  // namespace ist::example

int main(int argc, char** argv) {
  ros::init(argc, argv, "dodge");
  try {
    const ist::example::DodgeNode node(ros::NodeHandle(), ros::NodeHandle("~"));
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM("dodge_node cannot start:\n" << error.what());
    return 1;
  }
  return 0;
}
