#include "proximity/motion_bound.h"

#include <cmath>
#include <limits>
#include <vector>

namespace ist {
double joint_speed(const Kinematics::Joint& joint, const JointMotion& motion) {
  if (joint.type == JointType::kFixed || joint.has_unstated_pose()) return 0.0;
  const std::size_t index = joint.child - 1;
  const double change = motion.to[index] - motion.from[index];
  return std::isnan(change) ? 0.0 : std::abs(change) / motion.duration;
}

MotionBound::MotionBound(const Kinematics& kinematics, const JointMotion& motion, std::size_t body,
                         const Eigen::Vector3d& center, double radius, std::size_t ancestor)
    : body_(body), center_(center), radius_(radius) {
  const auto& joints = kinematics.joints();
  for (std::size_t at = body; at != ancestor; at = joints[at - 1].parent) {
    const Kinematics::Joint& joint = joints[at - 1];
    const double speed = joint_speed(joint, motion);
    if (joint.type == JointType::kPrismatic) {
      sliding_speed_ += speed;
    } else if (speed > 0.0) {
      movers_.push_back({at, joint.axis, speed});
    }
  }
}

double MotionBound::speed(Span<const Eigen::Isometry3d> X_FB) const {
  const Eigen::Vector3d center_F = X_FB[body_] * center_;
  double speed = sliding_speed_;
  for (const Mover& mover : movers_) {
    const Eigen::Vector3d to_center = center_F - X_FB[mover.child].translation();
    const Eigen::Vector3d axis_F = X_FB[mover.child].linear() * mover.axis;
    speed += mover.speed * (axis_F.cross(to_center).norm() + radius_);
  }
  return speed;
}

double time_within(double distance, double speed) {
  if (!(speed > 0.0)) return std::numeric_limits<double>::infinity();
  return (1.0 - 1e-9) * distance / speed;
}

}  // namespace ist
