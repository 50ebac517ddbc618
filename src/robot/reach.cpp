#include "internal/robot/reach.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// [m] How far the child's origin is from the parent's at most.
double longest(const Kinematics& kinematics, const Kinematics::Joint& joint) {
  if (joint.has_unstated_pose()) return kInfinity;
  const double to_joint = joint.X_PJ.translation().norm();
  if (joint.type != JointType::kPrismatic) return to_joint;
  const Kinematics::Joint& source = kinematics.joints()[joint.source];
  const auto slide = [&](double q) { return std::abs(joint.multiplier * q + joint.offset); };
  const double farthest = std::max(slide(source.lower), slide(source.upper));
  return to_joint + (std::isnan(farthest) ? kInfinity : farthest);
}

}  // namespace

double reach(const RobotModel& model, const Kinematics& kinematics) {
  std::vector<double> to_link(kinematics.links().size(), 0.0);
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    to_link[joint.child] = to_link[joint.parent] + longest(kinematics, joint);
  }
  double farthest = 0.0;
  for (const LinkModel& link : model.links) {
    if (!link.usable() || link.tree.empty()) continue;
    const auto index = kinematics.find_link(link.name);
    if (!index) return kInfinity;
    farthest = std::max(farthest, to_link[*index] + link.tree.center().norm() + link.tree.radius());
  }
  return farthest;
}

}  // namespace ist
