#pragma once

#include <string>

#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The kinematic reach of a robot: the radius of a sphere about the root link's origin that holds
/// the robot in every configuration. It bounds the workspace from outside by the sum of the lengths
/// along each chain of joints.
/// @param model  of the same description
/// @returns [m] no part of a usable link is ever farther from the root link's origin, whatever the
///          positions of revolute and continuous joints, and while prismatic ones keep to their
///          limits; +inf where joints are planar, floating or slide without limits. Thread safe.
double kinematic_reach(const RobotModel& model, const Kinematics& kinematics);

/// The robot's region of interest: a sphere about the root link's origin, in the fixed frame, of
/// the kinematic reach and the range of queries. Points outside it are discarded; no link can come
/// near them. The radius is infinite where the fixed frame is not a link that stands still in the
/// root link (the robot as a whole may then go anywhere), and where the reach is not bounded.
/// Thread safe.
/// @param model  of the same description
/// @param range  [m] how far from a link obstacles matter: max_distance of the queries
RegionOfInterest region_of_interest(const RobotModel& model, const Kinematics& kinematics,
                                    const std::string& fixed_frame, double range);

}  // namespace ist
