#include "ros/poses/stated_pose_source.h"

#include <algorithm>
#include <cmath>

#include "ros/poses/position_limits.h"
#include "ros/poses/transforms.h"

namespace ist {

StatedPoseSource::StatedPoseSource(std::shared_ptr<const Kinematics> kinematics,
                                   const TransformBuffer& buffer, const std::string& fixed_frame,
                                   const std::vector<std::string>& links, double timeout)
    : KinematicPoseSource(std::move(kinematics), buffer, fixed_frame, links,
                          std::vector<bool>(links.size(), true), timeout),
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

void StatedPoseSource::look_up(const ros::Time& now, StampedLinkPoses* poses) {
  reset(now, poses);
  root_known_ = false;
  kinematics_->place_joints(q_, &joints_);
  if (now.isZero()) return poses->set_problem(wanted_, {"the ROS clock has not started", true});
  const auto& bodies = kinematics_->bodies();
  const auto& joints = kinematics_->joints();
  ros::Time instant = now;  // the newest at which tf knows all that is left out
  const auto look_up_latest = [&](const std::string& to, const std::string& from,
                                  Eigen::Isometry3d* X) {
    ros::Time stamp;
    std::string problem = look_up_newest(buffer_, to, from, now, timeout_, X, &stamp);
    if (problem.empty() && !stamp.isZero()) instant = std::min(instant, stamp);
    return problem;
  };
  std::string problem = look_up_latest(fixed_frame_, bodies[0], &X_FR_);
  if (!problem.empty()) return poses->set_problem(wanted_, {problem, false});
  std::vector<PoseProblem> joint_problems(joints.size());
  std::vector<std::size_t> left_out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints_.known[j]) continue;
    left_out.push_back(j);
    joint_problems[j].text =
        look_up_latest(bodies[joints[j].parent], bodies[joints[j].child], &joints_.X_PC[j]);
  }
  problem = ist::look_up(buffer_, fixed_frame_, bodies[0], instant, &X_FR_);
  if (!problem.empty()) return poses->set_problem(wanted_, {problem, false});
  root_known_ = true;
  for (const std::size_t j : left_out) {
    std::string& why = joint_problems[j].text;
    const std::string &to = bodies[joints[j].parent], &from = bodies[joints[j].child];
    if (why.empty()) why = ist::look_up(buffer_, to, from, instant, &joints_.X_PC[j]);
    joints_.known[j] = why.empty();
    if (!why.empty()) {
      why.insert(0, "joint '" + joints[j].name + "' is not stated, and not known now: ");
    }
  }
  poses->stamp = instant;
  place(joint_problems, poses);
}

}  // namespace ist
