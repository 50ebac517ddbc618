#pragma once

#include <string>

#include "ist_proximity/robot/kinematics.h"

namespace ist {

// Limits of joint positions that come from outside the node.

/// The largest position of a prismatic joint [m]. No robot is larger, and the queries compute in
/// float, which resolves a millimetre there.
constexpr double kMaxPrismaticPosition = 1e4;
/// The largest position of a revolute or continuous joint [rad]. A double resolves a microradian
/// there; wheels count their turns.
constexpr double kMaxAngle = 1e9;

/// Says why a position [rad, m] cannot be used.
/// @returns empty, or the end of a sentence that begins with the joint's name
std::string why_not_a_position(const Kinematics::Joint& joint, double q);

/// Whether a position is so far outside the joint's limits that it is hardly true: by more than
/// three times the joint's range. A wrong unit does that.
bool is_implausible(const Kinematics::Joint& joint, double q);

}  // namespace ist
