#include "ros/poses/stated_pose_source.h"

#include <algorithm>
#include <cmath>

#include "ros/poses/mimic_agreement.h"
#include "ros/poses/position_limits.h"
#include "ros/poses/transforms.h"

namespace ist {

StatedPoseSource::StatedPoseSource(std::shared_ptr<const Kinematics> kinematics,
                                   const TransformBuffer& buffer, const std::string& fixed_frame,
                                   const std::vector<std::string>& links, double timeout,
                                   double mimic_tolerance, Stamp stamp)
    : KinematicPoseSource(std::move(kinematics), buffer, fixed_frame, links,
                          std::vector<bool>(links.size(), true), timeout),
      mimic_tolerance_(mimic_tolerance),
      stamp_(stamp),
      q_(kinematics_->joints().size(), std::nan("")) {}

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
      return title + " is planar or floating, so one position cannot give its pose; leave it out";
    }
    const std::string fault =
        why_not_a_position(kinematics_->joints()[*joint], configuration.position[i]);
    if (!fault.empty())
      return std::string("the position of ").append(title).append(" ").append(fault);
    if (!std::isnan(q[*joint])) return title + " is stated twice";
    q[*joint] = configuration.position[i];
  }
  q_ = std::move(q);
  return "";
}

std::string StatedPoseSource::hint() const {
  return "state its position, or provide it on tf or joint_states";
}

/// Compares where tf has a mimic joint with its formula, at the newest instant that tf knows of it
/// and of its source.
/// @returns empty where it follows, or is not in tf; else a sentence
std::string StatedPoseSource::why_strays(std::size_t joint, const ros::Time& now) const {
  const auto& bodies = kinematics_->bodies();
  const Kinematics::Joint& mimic = kinematics_->joints()[joint];
  const Kinematics::Joint& source = kinematics_->joints()[mimic.source];
  Eigen::Isometry3d X_mimic, X_source;
  ros::Time stamp, source_stamp;
  const std::string &parent = bodies[mimic.parent], &child = bodies[mimic.child];
  if (!look_up_newest(buffer_, parent, child, now, timeout_, &X_mimic, &stamp).empty()) return "";
  std::string why = look_up_newest(buffer_, bodies[source.parent], bodies[source.child], now,
                                   timeout_, &X_source, &source_stamp);
  if (why.empty() && !stamp.isZero() && !source_stamp.isZero()) {
    const ros::Time common = std::min(stamp, source_stamp);
    why = ist::look_up(buffer_, parent, child, common, &X_mimic);
    if (why.empty()) {
      why = ist::look_up(buffer_, bodies[source.parent], bodies[source.child], common, &X_source);
    }
  }
  if (!why.empty()) return "whether joint '" + mimic.name + "' follows is not known: " + why;
  return why_not_led(*kinematics_, joint, X_source, X_mimic, mimic_tolerance_);
}

/// Mimic joints that are elsewhere now than their formula says will hardly follow it: nobody knows
/// where they will be.
void StatedPoseSource::check_mimics(const ros::Time& now, std::vector<PoseProblem>* problems) {
  const auto& joints = kinematics_->joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    std::size_t led_by = j;
    while (std::isnan(q_[led_by]) && joints[led_by].leader != led_by)
      led_by = joints[led_by].leader;
    if (led_by == j || std::isnan(q_[led_by])) continue;
    std::string why = why_strays(j, now);
    if (why.empty()) continue;
    (*problems)[j] = {why, true};
    joints_.known[j] = false;
    mimics_follow_ = false;
  }
}

/// Looks up the newest pose of what is left out.
std::string StatedPoseSource::look_up_latest(const std::string& to, const std::string& from,
                                             const ros::Time& now, Eigen::Isometry3d* X) {
  ros::Time stamp;
  std::string problem = look_up_newest(buffer_, to, from, now, timeout_, X, &stamp);
  if (!problem.empty() || stamp.isZero()) return problem;
  instant_ = std::min(instant_, stamp);
  // Transforms may be stamped ahead.
  if (stamp_ == Stamp::kNow && stamp > now) problem = ist::look_up(buffer_, to, from, now, X);
  return problem;
}

void StatedPoseSource::look_up(const ros::Time& now, StampedLinkPoses* poses) {
  reset(now, poses);
  root_known_ = false;
  instant_ = now;
  kinematics_->place_joints(q_, &joints_);
  if (now.isZero()) return poses->set_problem(wanted_, {"the ROS clock has not started", true});
  const std::string problem = look_up_latest(fixed_frame_, kinematics_->bodies()[0], now, &X_FR_);
  if (!problem.empty()) return poses->set_problem(wanted_, {problem, false});
  look_up_joints(now, poses);
}

std::string StatedPoseSource::newest_root(Eigen::Isometry3d* X_FR) const {
  if (stamp_ != Stamp::kNow || !root_known_) return "";
  *X_FR = X_FR_;
  return kinematics_->bodies()[0];
}

void StatedPoseSource::look_up_joints_again(const ros::Time& now, StampedLinkPoses* poses) {
  reset(now, poses);
  kinematics_->place_joints(q_, &joints_);
  look_up_joints(now, poses);
}

/// Looks up the joints that are left out, and places the links.
void StatedPoseSource::look_up_joints(const ros::Time& now, StampedLinkPoses* poses) {
  const auto& bodies = kinematics_->bodies();
  const auto& joints = kinematics_->joints();
  mimics_follow_ = true;
  std::vector<PoseProblem> joint_problems(joints.size());
  std::vector<std::size_t> left_out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints_.known[j]) continue;
    left_out.push_back(j);
    joint_problems[j].text =
        look_up_latest(bodies[joints[j].parent], bodies[joints[j].child], now, &joints_.X_PC[j]);
  }
  // At the present each is where tf knew it last.
  const bool is_common = stamp_ == Stamp::kOfRobot;
  std::string problem;
  if (is_common) problem = ist::look_up(buffer_, fixed_frame_, bodies[0], instant_, &X_FR_);
  if (!problem.empty()) return poses->set_problem(wanted_, {problem, false});
  root_known_ = true;
  for (const std::size_t j : left_out) {
    std::string& why = joint_problems[j].text;
    const std::string &to = bodies[joints[j].parent], &from = bodies[joints[j].child];
    if (why.empty() && is_common) {
      why = ist::look_up(buffer_, to, from, instant_, &joints_.X_PC[j]);
    }
    joints_.known[j] = why.empty();
    if (!why.empty()) {
      why.insert(0, "joint '" + joints[j].name + "' is not stated, and not known now: ");
    }
  }
  check_mimics(now, &joint_problems);
  poses->stamp = stamp_ == Stamp::kNow ? now : instant_;
  place(joint_problems, poses);
}

}  // namespace ist
