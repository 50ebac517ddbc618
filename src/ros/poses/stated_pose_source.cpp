#include "ros/poses/stated_pose_source.h"

#include <cmath>

#include "ros/poses/transforms.h"

namespace ist {

StatedPoseSource::StatedPoseSource(std::shared_ptr<const Kinematics> kinematics,
                                   const tf2::BufferCore& buffer, const std::string& fixed_frame,
                                   const std::vector<std::string>& links, double timeout)
    : kinematics_(std::move(kinematics)),
      buffer_(buffer),
      fixed_frame_(fixed_frame),
      wanted_(links.size(), true),
      timeout_(timeout),
      q_(kinematics_->joints().size(), std::nan("")) {
  const std::size_t none = kinematics_->bodies().size();
  for (const std::string& name : links) {
    places_.push_back(kinematics_->find_body(name).value_or(none));
  }
}

std::string StatedPoseSource::state(const sensor_msgs::JointState& configuration) {
  const std::size_t count = configuration.name.size();
  if (configuration.position.size() != count) {
    return "it has " + std::to_string(count) + " names and " +
           std::to_string(configuration.position.size()) + " positions";
  }
  std::vector<double> q(q_.size(), std::nan(""));
  for (std::size_t i = 0; i < count; ++i) {
    const std::string title = "joint '" + configuration.name[i] + "'";
    const auto joint = kinematics_->find_joint(configuration.name[i]);
    if (!joint) return title + " is not in the URDF";
    if (kinematics_->joints()[*joint].has_unstated_pose()) {
      return title + " is planar or floating, which one position cannot tell; leave it out";
    }
    if (!std::isfinite(configuration.position[i])) {
      return "the position of " + title + " is NaN or infinite";
    }
    q[*joint] = configuration.position[i];
  }
  q_ = std::move(q);
  return "";
}

std::string StatedPoseSource::hint() const {
  return "state its position, or see that tf or joint states tell it";
}

void StatedPoseSource::look_up(const ros::Time& now, StampedLinkPoses* poses) {
  poses->reset(now, places_.size());
  bodies_.X_FB.assign(kinematics_->bodies().size(), Eigen::Isometry3d::Identity());
  bodies_.known.assign(bodies_.X_FB.size(), false);
  if (now.isZero()) return poses->blame(wanted_, "the ROS clock has not started");
  const std::string problem =
      look_up_newest(buffer_, fixed_frame_, kinematics_->bodies()[0], now, timeout_, &X_FR_);
  if (!problem.empty()) return poses->blame(wanted_, problem);

  kinematics_->place_joints(q_, &joints_);
  const auto& joints = kinematics_->joints();
  std::vector<std::string> joint_problems(joints.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints_.known[j]) continue;
    const std::string why =
        look_up_newest(buffer_, kinematics_->bodies()[joints[j].parent],
                       kinematics_->bodies()[joints[j].child], now, timeout_, &joints_.X_PC[j]);
    joints_.known[j] = why.empty();
    if (!why.empty()) {
      joint_problems[j] = "joint '" + joints[j].name + "' is not stated, and not known now: " + why;
    }
  }
  kinematics_->place_bodies(joints_, X_FR_, &bodies_);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (!wanted_[i]) continue;
    if (places_[i] == bodies_.X_FB.size()) {
      poses->problems[i] = "it is not in the URDF";
    } else if (bodies_.known[places_[i]]) {
      poses->X_FL[i] = bodies_.X_FB[places_[i]];
      poses->known[i] = true;
    } else {
      poses->problems[i] = joint_problems[*kinematics_->first_unknown(joints_, places_[i])];
    }
  }
}

void StatedPoseSource::look_up_all(const Kinematics& /*kinematics*/, const ros::Time& /*instant*/,
                                   BodyPoses* bodies) {
  *bodies = bodies_;
}

}  // namespace ist
