#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// A ball beyond which points are not kept, because no link ever gets so near to them that they
/// count. Queries check it: a link that does get there does not know what is beyond.
struct Horizon {
  Eigen::Vector3d center_F = Eigen::Vector3d::Zero();       ///< [m] in the fixed frame
  double radius = std::numeric_limits<double>::infinity();  ///< [m] >= 0
};

/// The robot's reach, and what is to be seen from there. None (an infinite radius) where the fixed
/// frame is not a link that stands still in the root link: then the robot as a whole may go
/// anywhere. Nor where the reach is not bounded. Thread safe.
/// @param model   of the same description
/// @param beyond  [m] how far links look
Horizon horizon_of(const RobotModel& model, const Kinematics& kinematics,
                   const std::string& fixed_frame, double beyond);

}  // namespace ist
