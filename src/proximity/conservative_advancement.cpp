#include "proximity/conservative_advancement.h"

namespace ist {

bool MovedRobot::begin(const JointMotion& motion, const JointPoses& still) {
  const std::size_t joints = kinematics().joints().size();
  if (motion.from.size() != joints || motion.to.size() != joints || still.X_PC.size() != joints ||
      still.known.size() != joints) {
    return false;
  }
  if (!(motion.duration > 0.0) || !std::isfinite(motion.duration)) return false;
  motion_ = motion;
  place_mimics(kinematics(), &motion_);
  still_ = &still;
  return true;
}

void MovedRobot::place(double time, const Eigen::Isometry3d& X_FR) {
  const auto& joints = kinematics().joints();
  const double s = std::min(time / motion_.duration, 1.0);
  moved_ = *still_;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!(joint_speed(joints[j], motion_) > 0.0)) continue;
    moved_.X_PC[j] = kinematics().joint_pose(j, (1.0 - s) * motion_.from[j] + s * motion_.to[j]);
    moved_.known[j] = true;
  }
  forward_.run(moved_, X_FR);
}

}  // namespace ist
