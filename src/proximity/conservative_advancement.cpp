#include "proximity/conservative_advancement.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace ist {

bool MovedRobot::begin(const JointMotion& motion, const JointPoses& still) {
  const std::size_t joints = kinematics().joints().size();
  if (motion.from.size() != joints || motion.to.size() != joints || still.X_PC.size() != joints ||
      still.known.size() != joints) {
    return false;
  }
  if (!(motion.duration > 0.0) || !std::isfinite(motion.duration)) return false;
  for (std::size_t j = 0; j < joints; ++j) {
    if (std::isnan(motion.from[j]) != std::isnan(motion.to[j])) return false;
    if (std::abs(motion.from[j]) > kLargestMotion || std::abs(motion.to[j]) > kLargestMotion) {
      return false;
    }
  }
  motion_ = motion;
  kinematics().place_mimics(&motion_.from);
  kinematics().place_mimics(&motion_.to);
  still_ = &still;
  return true;
}

MotionBound MovedRobot::bound_deviation(std::size_t body, const Eigen::Vector3d& center,
                                        double radius, const std::vector<double>& deviation) const {
  JointMotion off{std::vector<double>(deviation.size(), 0.0), deviation, 1.0};
  for (const std::size_t j : kinematics().mimics()) {
    const Kinematics::Joint& joint = kinematics().joints()[j];
    off.to[j] = std::max(off.to[j], std::abs(joint.mimic.multiplier) * off.to[joint.leader]);
  }
  return {kinematics(), off, body, center, radius};
}

void MovedRobot::place(double time, const Eigen::Isometry3d& X_FR) {
  const auto& joints = kinematics().joints();
  const double s = std::min(time / motion_.duration, 1.0);
  moved_ = *still_;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double q = (1.0 - s) * motion_.from[j] + s * motion_.to[j];
    if (joints[j].type == JointType::kFixed || joints[j].has_unstated_pose() || !std::isfinite(q)) {
      continue;
    }
    moved_.X_PC[j] = kinematics().joint_pose(j, q);
    moved_.known[j] = true;
  }
  forward_.run(moved_, X_FR);
}

}  // namespace ist
