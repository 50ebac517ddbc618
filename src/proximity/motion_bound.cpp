#include "proximity/motion_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ist {
namespace {

// [m] At most this far is the joint's child frame from its parent's during the motion.
double length(const Kinematics::Joint& joint, const JointMotion& motion, const JointPoses& still,
              std::size_t index) {
  const double to_joint = joint.X_PJ.translation().norm();
  if (joint.type == JointType::kPrismatic && joint_speed(joint, motion) > 0.0) {
    const auto position = [&](double q) { return std::abs(joint.multiplier * q + joint.offset); };
    return to_joint +
           std::max(position(motion.from[joint.source]), position(motion.to[joint.source]));
  }
  return still.known[index] ? still.X_PC[index].translation().norm() : to_joint;
}

}  // namespace

double joint_speed(const Kinematics::Joint& joint, const JointMotion& motion) {
  if (joint.type == JointType::kFixed || joint.has_unstated_pose()) return 0.0;
  const double way = motion.to[joint.source] - motion.from[joint.source];
  return std::isfinite(way) ? std::abs(joint.multiplier * way) / motion.duration : 0.0;
}

MotionBound::MotionBound(const Kinematics& kinematics, const JointMotion& motion,
                         const JointPoses& still, std::size_t link, const Eigen::Vector3d& center,
                         double radius)
    : link_(link), center_(center), radius_(radius) {
  const auto& joints = kinematics.joints();
  double reach = center.norm();  // [m] from the child frame of the joint at hand to the centre
  double center_speed = 0.0;     // [m/s] by the joints nearer to the link
  for (std::size_t at = link; at > 0; at = joints[at - 1].parent) {
    const Kinematics::Joint& joint = joints[at - 1];
    const double speed = joint_speed(joint, motion);
    const bool turns = joint.type != JointType::kPrismatic;
    if (speed > 0.0) {
      movers_.push_back({at, turns, joint.axis, speed});
      if (turns) {
        growth_ += speed * center_speed;
      } else {
        slides_ += speed;
      }
      center_speed += turns ? speed * reach : speed;
    }
    reach += length(joint, motion, still, at - 1);
  }
}

double MotionBound::time_for(double distance, const std::vector<Eigen::Isometry3d>& X_FL) const {
  const Eigen::Vector3d center_F = X_FL[link_] * center_;
  double speed = slides_;
  for (const Mover& mover : movers_) {
    if (!mover.turns) continue;
    const Eigen::Vector3d to_center = center_F - X_FL[mover.child].translation();
    const Eigen::Vector3d axis_F = X_FL[mover.child].linear() * mover.axis;
    speed += mover.speed * (axis_F.cross(to_center).norm() + radius_);
  }
  if (!(speed > 0.0)) return std::numeric_limits<double>::infinity();
  // A little less, for what rounds.
  return (1.0 - 1e-9) * 2.0 * distance /
         (speed + std::sqrt(speed * speed + 2.0 * growth_ * distance));
}

}  // namespace ist
