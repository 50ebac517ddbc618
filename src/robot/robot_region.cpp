#include "ist_proximity/robot/link_poses.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

constexpr double kSlack = 1e-3;  // [m] for rounding, and for joints a little past their limits

// [m] The largest distance between the origins of a joint's child and parent.
double largest_offset(const Kinematics& kinematics, const Kinematics::Joint& joint) {
  if (joint.has_unstated_pose()) return kInfinity;
  const double to_joint = joint.X_PJ.translation().norm();
  if (joint.type != JointType::kPrismatic) return to_joint;
  const Kinematics::Joint& source = kinematics.joints()[joint.source];
  const auto slide = [&](double q) { return std::abs(joint.multiplier * q + joint.offset); };
  double farthest = std::max(slide(source.lower), slide(source.upper));
  // Its own position may be stated.
  const double own = std::max(std::abs(joint.lower), std::abs(joint.upper));
  if (std::isfinite(own)) farthest = std::max(farthest, own);
  return farthest <= kMaxLength ? to_joint + farthest : kInfinity;  // it may be NaN
}

}  // namespace

double kinematic_reach(const RobotModel& model, const Kinematics& kinematics) {
  std::vector<double> to_body(kinematics.bodies().size(), 0.0);
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    to_body[joint.child] = to_body[joint.parent] + largest_offset(kinematics, joint);
  }
  double farthest = 0.0;
  for (const LinkModel& link : model.links) {
    if (!link.usable() || link.tree.empty()) continue;
    const auto body = kinematics.find_body(link.name);
    if (!body) return kInfinity;
    farthest = std::max(farthest, to_body[*body] + link.tree.center().norm() + link.tree.radius());
  }
  return farthest;
}

RegionOfInterest region_of_interest(const RobotModel& model, const Kinematics& kinematics,
                                    const std::string& fixed_frame, double range) {
  const auto frame = kinematics.find_body(fixed_frame);
  if (!frame) return {};
  Eigen::Isometry3d X_RF = Eigen::Isometry3d::Identity();
  for (std::size_t body = *frame; body > 0;) {
    const Kinematics::Joint& joint = kinematics.joints()[body - 1];
    if (joint.type != JointType::kFixed) return {};
    X_RF = joint.X_PJ * X_RF;
    body = joint.parent;
  }
  return {X_RF.inverse().translation(), kinematic_reach(model, kinematics) + range + kSlack};
}

}  // namespace ist
