#pragma once

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// How far the robot gets.
/// @param model  of the same description
/// @returns [m] no part of a usable link is ever farther from the root link's origin, whatever the
///          positions of revolute and continuous joints, and while prismatic ones keep to their
///          limits. inf where joints are planar, floating or slide without limits. Thread safe.
double reach(const RobotModel& model, const Kinematics& kinematics);

}  // namespace ist
