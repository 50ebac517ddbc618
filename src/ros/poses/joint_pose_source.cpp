#include "ros/poses/joint_pose_source.h"

#include <algorithm>
#include <cmath>

#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/poses/transforms.h"

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
      placer_(kinematics_, links),
      wanted_(wanted),
      timeout_(timeout),
      tf_source_(buffer, fixed_frame, links, wanted, timeout) {}

std::string JointPoseSource::hint() const {
  return "does everything that moves joints publish on '" + listener_.report().topic + "'?";
}

/// Reads the fresh positions, and notes why the others are not known.
/// @returns the newest stamp of a fresh position; `now` when there is none
ros::Time JointPoseSource::read_positions(const ros::Time& now) {
  const auto& joints = kinematics_->joints();
  if (which_ == Which::kTaken) {
    listener_.taken(*kinematics_, &positions_);
  } else {
    listener_.newest(*kinematics_, &positions_);
  }
  positions_.resize(joints.size());
  q_.assign(joints.size(), std::nan(""));
  joint_problems_.assign(joints.size(), std::string());
  ros::Time instant;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].is_free()) continue;
    const JointPosition& position = positions_[j];
    if (position.stamp.isZero()) {
      joint_problems_[j] = "joint '" + joints[j].name + "' has not come in any joint state";
      continue;
    }
    const double age = seconds_between(position.stamp, now);
    if (age > timeout_) {
      joint_problems_[j] =
          "the newest position of joint '" + joints[j].name +
          format_text("' is %.2f s old, allowed is %.2f s (~pose_timeout)", age, timeout_);
      continue;
    }
    q_[j] = position.q;
    instant = std::max(instant, position.stamp);
  }
  return instant.isZero() ? now : instant;
}

/// Looks up the pose of a child frame in its parent at the instant. Notes that tf is behind when it
/// has a fresh pose for an earlier instant only.
bool JointPoseSource::look_up_in_tf(const std::string& parent, const std::string& child,
                                    const ros::Time& now, const ros::Time& instant,
                                    Eigen::Isometry3d* X, std::string* problem) {
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
  poses->reset(now, placer_.size());
  tf_is_behind_ = false;
  placer_.reset();
  if (now.isZero()) return poses->set_problem(wanted_, "the ROS clock has not started");

  const ros::Time instant = read_positions(now);
  kinematics_->place_joints(q_, &joints_);
  const auto& joints = kinematics_->joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].has_unstated_pose()) continue;
    joints_.known[j] = look_up_in_tf(kinematics_->bodies()[joints[j].parent],
                                     kinematics_->bodies()[joints[j].child], now, instant,
                                     &joints_.X_PC[j], &joint_problems_[j]);
  }
  Eigen::Isometry3d X_FR = Eigen::Isometry3d::Identity();
  std::string root_problem;
  const bool root_known =
      look_up_in_tf(fixed_frame_, kinematics_->bodies()[0], now, instant, &X_FR, &root_problem);
  if (tf_is_behind_) return tf_source_.look_up(now, poses);
  if (!root_known) return poses->set_problem(wanted_, root_problem);

  // A mimic joint is unknown for the same reason as the joint that it follows.
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].source != j) joint_problems_[j] = joint_problems_[joints[j].source];
  }
  poses->stamp = instant;
  placer_.place(joints_, X_FR, wanted_, joint_problems_, poses);
}

void JointPoseSource::look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                                  BodyPoses* bodies) {
  if (tf_is_behind_) return tf_source_.look_up_all(kinematics, instant, bodies);
  *bodies = placer_.bodies();
}

}  // namespace ist
