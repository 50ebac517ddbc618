#include "ros/input/other_robot.h"

#include <algorithm>
#include <utility>

#include "ist_proximity/geometry/error.h"
#include "ros/common/frame_name.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

/// Frames that are known from the other robot's joint states alone.
constexpr const char* kOwnFrame = "(other robot) ";

/// How a frame that is in a frame R moves in another that R moves in.
Lag compose(const Lag& outer, const Eigen::Isometry3d& X_FR, const Lag& inner) {
  if (inner.windows == 0) return outer;
  Lag both = inner;
  for (std::size_t k = 0; k < both.windows; ++k) {
    both.moved[k] = X_FR * inner.moved[k] * X_FR.inverse();
  }
  if (outer.windows == 0) return both;
  // The one of the higher share counts for both.
  if (outer.age * both.window > both.age * outer.window) {
    both.age = outer.age;
    both.window = outer.window;
  }
  for (std::size_t k = 0; k < outer.windows; ++k) {
    both.moved[k] = k < both.windows ? outer.moved[k] * both.moved[k] : outer.moved[k];
  }
  both.windows = std::max(both.windows, outer.windows);
  return both;
}

}  // namespace

OtherRobot::OtherRobot(const OtherRobotConfig& config, const std::string& base_frame,
                       const ros::NodeHandle& nh)
    : config_(config), base_frame_(without_slash(base_frame)), nh_(nh) {
  if (config.joint_states.empty()) return;
  own_buffer_ = std::make_shared<TransformBuffer>(ros::Duration(10.0));
  const ros::NodeHandle remapped(
      nh_, "", {{nh_.resolveName("joint_states", false), nh_.resolveName(config.joint_states)}});
  joint_states_ = std::make_unique<JointStateListener>(own_buffer_.get(), remapped, [] {});
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
    object.frame = own_buffer_ ? kOwnFrame + link.name : config_.tf_prefix + link.name;
    object.geometry = std::move(link.geometry);
    if (link.error.empty()) {
      links->push_back(std::move(object));
    } else {
      faults->push_back({object.name, "the other robot's " + link.error});
    }
  }
  if (joint_states_) joint_states_->set_kinematics(kinematics);
  const std::lock_guard<std::mutex> lock(mutex_);
  root_link_ = description.root_link;
  return "";
}

bool OtherRobot::owns(const std::string& frame) const {
  return own_buffer_ && frame.compare(0, std::char_traits<char>::length(kOwnFrame), kOwnFrame) == 0;
}

std::string OtherRobot::look_up_frame(const TransformBuffer& buffer, const std::string& fixed_frame,
                                      const std::string& frame, const ros::Time& time,
                                      double max_age, Eigen::Isometry3d* X_FB, Lag* lag) const {
  const std::string link = frame.substr(std::char_traits<char>::length(kOwnFrame));
  std::string root;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    root = root_link_;
  }
  const std::string base = base_frame_.empty() ? config_.tf_prefix + root : base_frame_;
  Eigen::Isometry3d X_FR = Eigen::Isometry3d::Identity(), X_RB = Eigen::Isometry3d::Identity();
  std::string problem;
  Lag lag_FR, lag_RB;
  if (base != fixed_frame) {
    problem = look_up_near(buffer, fixed_frame, base, time, max_age, &X_FR, &lag_FR);
  }
  if (problem.empty() && link != root) {
    problem = look_up_near(*own_buffer_, root, link, time, max_age, &X_RB, &lag_RB);
    if (!problem.empty()) {
      problem =
          "the other robot's joint states (" + config_.joint_states + ") give no pose: " + problem;
    }
  }
  if (!problem.empty()) return problem;
  *X_FB = X_FR * X_RB;
  *lag = compose(lag_FR, X_FR, lag_RB);
  return "";
}

}  // namespace ist
