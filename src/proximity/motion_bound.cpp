#include "proximity/motion_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace ist {
namespace {

// [m] The largest distance between the origins of a joint's child and parent during the motion.
double largest_offset(const Kinematics::Joint& joint, const JointMotion& motion,
                      const JointPoses& still, std::size_t index) {
  const double to_joint = joint.X_PJ.translation().norm();
  if (joint.type == JointType::kPrismatic && joint_speed(joint, motion) > 0.0) {
    return to_joint + std::max(std::abs(motion.from[index]), std::abs(motion.to[index]));
  }
  return still.known[index] ? still.X_PC[index].translation().norm() : to_joint;
}

}  // namespace

double joint_speed(const Kinematics::Joint& joint, const JointMotion& motion) {
  if (joint.type == JointType::kFixed || joint.has_unstated_pose()) return 0.0;
  const std::size_t index = joint.child - 1;
  const double change = motion.to[index] - motion.from[index];
  return std::isfinite(change) ? std::abs(change) / motion.duration : 0.0;
}

void place_mimics(const Kinematics& kinematics, JointMotion* motion) {
  for (std::size_t j = 0; j < motion->from.size(); ++j) {
    const Kinematics::Joint& joint = kinematics.joints()[j];
    if (joint.source == j) continue;
    for (std::vector<double>* q : {&motion->from, &motion->to}) {
      if (std::isnan((*q)[j])) (*q)[j] = joint.multiplier * (*q)[joint.source] + joint.offset;
    }
  }
}

MotionBound::MotionBound(const Kinematics& kinematics, const JointMotion& motion,
                         const JointPoses& still, std::size_t body, const Eigen::Vector3d& center,
                         double radius, std::size_t ancestor)
    : body_(body), center_(center), radius_(radius) {
  const auto& joints = kinematics.joints();
  double lever = center.norm();  // [m] from the origin of the joint's child body to the centre
  double center_speed = 0.0;     // [m/s] by the joints nearer to the body
  for (std::size_t at = body; at != ancestor; at = joints[at - 1].parent) {
    const Kinematics::Joint& joint = joints[at - 1];
    const double speed = joint_speed(joint, motion);
    const bool turns = joint.type != JointType::kPrismatic;
    if (speed > 0.0) {
      movers_.push_back({at, turns, joint.axis, speed});
      if (turns) {
        growth_ += speed * center_speed;
      } else {
        sliding_speed_ += speed;
      }
      center_speed += turns ? speed * lever : speed;
    }
    lever += largest_offset(joint, motion, still, at - 1);
  }
}

double MotionBound::speed(Span<const Eigen::Isometry3d> X_FB) const {
  const Eigen::Vector3d center_F = X_FB[body_] * center_;
  double speed = sliding_speed_;
  for (const Mover& mover : movers_) {
    if (!mover.turns) continue;
    const Eigen::Vector3d to_center = center_F - X_FB[mover.child].translation();
    const Eigen::Vector3d axis_F = X_FB[mover.child].linear() * mover.axis;
    speed += mover.speed * (axis_F.cross(to_center).norm() + radius_);
  }
  return speed;
}

double MotionBound::time_for(double distance, Span<const Eigen::Isometry3d> X_FB) const {
  return time_within(distance, speed(X_FB), growth_);
}

double time_within(double distance, double speed, double growth) {
  if (!(speed > 0.0)) return std::numeric_limits<double>::infinity();
  // The root of a h + b h^2 / 2 = distance.
  return (1.0 - 1e-9) * 2.0 * distance /
         (speed + std::sqrt(speed * speed + 2.0 * growth * distance));
}

}  // namespace ist
