#pragma once

#include <string>

#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The robot's reach, and what is to be seen from there. None (an infinite radius) where the fixed
/// frame is not a link that stands still in the root link: then the robot as a whole may go
/// anywhere. Nor where the reach is not bounded. Thread safe.
/// @param model   of the same description
/// @param beyond  [m] how far links look
RegionOfInterest region_of_interest(const RobotModel& model, const Kinematics& kinematics,
                                    const std::string& fixed_frame, double beyond);

}  // namespace ist
