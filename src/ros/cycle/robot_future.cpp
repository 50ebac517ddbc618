#include "ros/cycle/robot_future.h"

#include "internal/geometry/numbers.h"
#include "ros/common/text.h"

namespace ist {

RobotFuture::RobotFuture(const JointDeceleration& deceleration,
                         std::shared_ptr<const Kinematics> kinematics,
                         const std::vector<LinkBox>& boxes,
                         const std::vector<std::size_t>& monitored)
    : is_stated_(deceleration.is_stated()), kinematics_(std::move(kinematics)) {
  if (!is_stated_) return;
  now_.resize(monitored.size());
  at_full_speed_.resize(monitored.size());
  if (!kinematics_) return;
  for (const std::size_t i : monitored) {
    boxes_.push_back(boxes[i].box_L);
    links_.push_back(kinematics_->find_body(boxes[i].link).value_or(0));
  }
  std::vector<std::string> unknown;
  for (const auto& [joint, value] : deceleration.by_joint) {
    if (!kinematics_->find_joint(joint)) unknown.push_back("'" + joint + "'");
  }
  if (!unknown.empty()) {
    problem_ = "~joint_deceleration names " + join(unknown, ", ") +
               ": the URDF has no such joint, and robot_future stays -inf";
  }
  decelerations_ = deceleration.of(*kinematics_);
  if (!problem_.empty()) decelerations_.clear();
  std::vector<double> limits;
  for (const Kinematics::Joint& joint : kinematics_->joints()) limits.push_back(joint.speed);
  brake_joints(*kinematics_, limits, decelerations_, &fastest_);
}

void RobotFuture::update(PoseSource* source, const ros::Time& instant) {
  now_.assign(now_.size(), StoppingReach());
  at_full_speed_.assign(now_.size(), StoppingReach());
  if (!kinematics_ || source == nullptr) return;
  brake_joints(*kinematics_, source->joint_velocities(), decelerations_, &joints_);
  source->look_up_all(*kinematics_, instant, &bodies_);
  for (std::size_t i = 0; i < links_.size(); ++i) {
    if (first_body_needed(*kinematics_, bodies_.known, links_[i])) continue;
    now_[i] = stopping_reach(*kinematics_, joints_, links_[i], boxes_[i], bodies_.X_FB);
    at_full_speed_[i] = stopping_reach(*kinematics_, fastest_, links_[i], boxes_[i], bodies_.X_FB);
  }
}

double RobotFuture::left_of(std::size_t link, double lower_bound) const {
  if (!is_stated_) return kNaN;
  const double reach = now_[link].distance;
  return reach < kInfinity ? lower_bound - reach : -kInfinity;
}

}  // namespace ist
