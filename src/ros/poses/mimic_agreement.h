#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>

#include "ist_proximity/robot/kinematics.h"

namespace ist {

// Whether mimic joints are where the joints that they follow put them. One that is stated elsewhere
// does not move as its formula says.

/// [rad, m] How far a joint at `present` is from `q`; of a continuous one without whole turns.
double distance_between(const Kinematics::Joint& joint, double present, double q);

/// @param mimic      a joint of the kinematics with another source than itself
/// @param source     [rad, m] where its source is now
/// @param stated     [rad, m] where the mimic joint is stated now; NaN: nobody states it
/// @param tolerance  [rad, m] by which it may be elsewhere
/// @returns empty where it follows, else a sentence
std::string why_not_led(const Kinematics& kinematics, std::size_t mimic, double source,
                        double stated, double tolerance);

/// The same of the poses of both child bodies in their parent bodies. A pose does not tell whole
/// turns of its joint: the joint counts as following where any number of them agrees.
std::string why_not_led(const Kinematics& kinematics, std::size_t mimic,
                        const Eigen::Isometry3d& X_source, const Eigen::Isometry3d& X_stated,
                        double tolerance);

}  // namespace ist
