#include "ros/input/other_robot.h"

#include <utility>

#include "ist_proximity/geometry/error.h"
#include "ros/common/frame_name.h"

namespace ist {

OtherRobot::OtherRobot(const OtherRobotConfig& config, const std::string& base_frame,
                       const std::string& source, const ros::NodeHandle& nh,
                       TransformBuffer* buffer)
    : config_(config),
      base_frame_(without_slash(base_frame)),
      prefix_(config.joint_states.empty() ? config.tf_prefix : "(robot of " + source + ") "),
      nh_(nh),
      buffer_(*buffer) {
  if (config.joint_states.empty()) return;
  joint_states_ =
      std::make_unique<JointStateListener>(buffer, nh, config.joint_states, prefix_, [] {});
}

std::string OtherRobot::read(const std::function<bool()>& cancelled,
                             std::vector<WorldObject>* links, std::vector<WorldFault>* faults) {
  std::string key, urdf;
  if (!nh_.searchParam(config_.description, key) || !nh_.getParam(key, urdf)) {
    return "waiting for the parameter '" + config_.description + "' with the other robot's URDF";
  }
  std::shared_ptr<const Kinematics> kinematics;
  RobotDescription description;
  try {
    description = parse_urdf(
        urdf, GeometrySource::kCollision, environment_package_finder(),
        [&](const std::string& /*link*/, const std::string& /*mesh*/) { return !cancelled(); });
    kinematics = std::make_shared<const Kinematics>(description);
  } catch (const ModelError& error) {
    return "the other robot's URDF in '" + key + "' cannot be used: " + error.what();
  }
  for (LinkDescription& link : description.links) {
    WorldObject object;
    object.name = config_.tf_prefix + link.name;
    object.frame = prefix_ + link.name;
    object.geometry = std::move(link.geometry);
    if (link.error.empty()) {
      links->push_back(std::move(object));
    } else {
      faults->push_back({object.name, "the other robot's " + link.error});
    }
  }
  if (!joint_states_) return "";
  const std::string& root = description.root_link;
  geometry_msgs::TransformStamped base;
  base.header.frame_id = base_frame_.empty() ? config_.tf_prefix + root : base_frame_;
  base.child_frame_id = prefix_ + root;
  base.transform.rotation.w = 1.0;
  const std::string fault = buffer_.add(base, prefix_, true, ros::Time());
  if (!fault.empty()) return fault;
  joint_states_->set_kinematics(kinematics);
  return "";
}

bool OtherRobot::owns(const std::string& frame) const {
  return joint_states_ && frame.compare(0, prefix_.size(), prefix_) == 0;
}

}  // namespace ist
