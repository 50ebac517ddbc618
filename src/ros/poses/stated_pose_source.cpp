#include "ros/poses/stated_pose_source.h"

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
  const std::string problem =
      look_up_newest(buffer_, fixed_frame_, kinematics_->bodies()[0], now, timeout_, &X_FR_);
  if (!problem.empty()) return poses->set_problem(wanted_, {problem, false});
  root_known_ = true;

  const auto& joints = kinematics_->joints();
  std::vector<PoseProblem> joint_problems(joints.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints_.known[j]) continue;
    const std::string why =
        look_up_newest(buffer_, kinematics_->bodies()[joints[j].parent],
                       kinematics_->bodies()[joints[j].child], now, timeout_, &joints_.X_PC[j]);
    joints_.known[j] = why.empty();
    if (!why.empty()) {
      joint_problems[j].text =
          "joint '" + joints[j].name + "' is not stated, and not known now: " + why;
    }
  }
  place(joint_problems, poses);
}

}  // namespace ist
