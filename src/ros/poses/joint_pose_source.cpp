#include "ros/poses/joint_pose_source.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ros/poses/transforms.h"
#include "ros/ros_time.h"

namespace ist {

JointPoseSource::JointPoseSource(std::shared_ptr<const Kinematics> kinematics,
                                 JointStateListener* joints, Which which,
                                 const tf2::BufferCore& buffer, const std::string& fixed_frame,
                                 const std::vector<std::string>& links,
                                 const std::vector<bool>& wanted, double timeout)
    : kinematics_(std::move(kinematics)),
      listener_(*joints),
      which_(which),
      buffer_(buffer),
      fixed_frame_(fixed_frame),
      wanted_(wanted),
      timeout_(timeout),
      behind_(buffer, fixed_frame, links, wanted, timeout) {
  const std::size_t none = kinematics_->bodies().size();
  for (const std::string& name : links) {
    places_.push_back(kinematics_->find_body(name).value_or(none));
  }
}

std::string JointPoseSource::hint() const {
  return "does everything that moves joints publish on '" + listener_.facts().topic + "'?";
}

/// Positions that are fresh, problems of those that are not.
/// @returns the newest stamp; `now` when nothing is fresh
ros::Time JointPoseSource::read_positions(const ros::Time& now) {
  const auto& joints = kinematics_->joints();
  if (which_ == Which::kTaken) {
    listener_.taken(*kinematics_, &newest_);
  } else {
    listener_.newest(*kinematics_, &newest_);
  }
  newest_.resize(joints.size());
  q_.assign(joints.size(), std::nan(""));
  joint_problems_.assign(joints.size(), std::string());
  ros::Time instant;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].is_free()) continue;
    const JointStateListener::Position& position = newest_[j];
    if (position.stamp.isZero()) {
      joint_problems_[j] = "joint '" + joints[j].name + "' has not come in any joint state";
      continue;
    }
    const double age = seconds_between(position.stamp, now);
    if (age > timeout_) {
      char text[96];
      std::snprintf(text, sizeof text, "' is %.2f s old, allowed is %.2f s (~pose_timeout)", age,
                    timeout_);
      joint_problems_[j] = "the newest position of joint '" + joints[j].name + text;
      continue;
    }
    q_[j] = position.q;
    instant = std::max(instant, position.stamp);
  }
  return instant.isZero() ? now : instant;
}

/// Where one frame is in another at the instant; notes when tf has it, fresh, for an earlier one
/// only.
bool JointPoseSource::ask_tf(const std::string& parent, const std::string& child,
                             const ros::Time& now, const ros::Time& instant, Eigen::Isometry3d* X,
                             std::string* problem) {
  if (is_known(buffer_, parent, child, instant, problem)) {
    *problem = ist::look_up(buffer_, parent, child, instant, X);
    return problem->empty();
  }
  ros::Time stamp;
  Eigen::Isometry3d ignored;
  std::string ignored_problem;
  if (is_known(buffer_, parent, child, ros::Time(), &ignored_problem) &&
      ist::look_up(buffer_, parent, child, ros::Time(), &ignored, &stamp).empty() &&
      stamp < instant && seconds_between(stamp, now) <= timeout_) {
    tf_is_behind_ = true;
  }
  return false;
}

void JointPoseSource::look_up(const ros::Time& now, StampedLinkPoses* poses) {
  poses->reset(now, places_.size());
  tf_is_behind_ = false;
  bodies_.X_FB.assign(kinematics_->bodies().size(), Eigen::Isometry3d::Identity());
  bodies_.known.assign(bodies_.X_FB.size(), false);
  if (now.isZero()) return poses->blame(wanted_, "the ROS clock has not started");

  const ros::Time instant = read_positions(now);
  kinematics_->place_joints(q_, &joints_);
  const auto& joints = kinematics_->joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].has_unstated_pose()) continue;
    joints_.known[j] =
        ask_tf(kinematics_->bodies()[joints[j].parent], kinematics_->bodies()[joints[j].child], now,
               instant, &joints_.X_PC[j], &joint_problems_[j]);
  }
  Eigen::Isometry3d X_FR = Eigen::Isometry3d::Identity();
  std::string root_problem;
  const bool root_known =
      ask_tf(fixed_frame_, kinematics_->bodies()[0], now, instant, &X_FR, &root_problem);
  if (tf_is_behind_) return behind_.look_up(now, poses);
  if (!root_known) return poses->blame(wanted_, root_problem);

  poses->stamp = instant;
  kinematics_->place_bodies(joints_, X_FR, &bodies_);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (!wanted_[i]) continue;
    if (places_[i] == bodies_.X_FB.size()) {
      poses->problems[i] = "it is not in the URDF";
    } else if (bodies_.known[places_[i]]) {
      poses->X_FL[i] = bodies_.X_FB[places_[i]];
      poses->known[i] = true;
    } else {
      const std::size_t joint = *kinematics_->first_unknown(joints_, places_[i]);
      poses->problems[i] = joint_problems_[joints[joint].source];
    }
  }
}

void JointPoseSource::look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                                  BodyPoses* bodies) {
  if (tf_is_behind_) return behind_.look_up_all(kinematics, instant, bodies);
  *bodies = bodies_;
}

}  // namespace ist
