#pragma once

#include "ist_proximity/proximity/time_of_impact.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// Poses of all joints after a part of a motion: of those that it moves, and of the others.
/// @param still  poses of joints that the motion does not move
/// @param time   [s] since its start
/// @param moved  overwritten
void place_moved_joints(const Kinematics& kinematics, const JointMotion& motion,
                        const JointPoses& still, double time, JointPoses* moved);

}  // namespace ist
