#include "proximity/moved_joints.h"

#include <algorithm>

#include "proximity/motion_bound.h"

namespace ist {

void place_moved_joints(const Kinematics& kinematics, const JointMotion& motion,
                        const JointPoses& still, double time, JointPoses* moved) {
  const auto& joints = kinematics.joints();
  const double s = std::min(time / motion.duration, 1.0);
  *moved = still;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!(joint_speed(joints[j], motion) > 0.0)) continue;
    moved->X_PC[j] = kinematics.joint_pose(j, (1.0 - s) * motion.from[j] + s * motion.to[j]);
    moved->known[j] = true;
  }
}

}  // namespace ist
