#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>

#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// Whether a mimic joint is where the joint that it follows puts it. One that is elsewhere does not
/// move as its formula says. A pose does not tell whole turns of its joint: the joint counts as
/// following where any number of them agrees.
/// @param mimic      a joint of the kinematics with another source than itself
/// @param X_source   the pose of its source's child body in that joint's parent body
/// @param X_stated   the same of the mimic joint itself
/// @param tolerance  [rad, m] by which it may be elsewhere
/// @returns empty where it follows, else a sentence
std::string why_not_led(const Kinematics& kinematics, std::size_t mimic,
                        const Eigen::Isometry3d& X_source, const Eigen::Isometry3d& X_stated,
                        double tolerance);

}  // namespace ist
