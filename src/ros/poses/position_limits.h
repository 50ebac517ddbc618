#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "ist_proximity/robot/kinematics.h"
#include "ros/common/text.h"

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
inline std::string why_not_a_position(const Kinematics::Joint& joint, double q) {
  if (!std::isfinite(q)) return "is NaN or infinite";
  const bool is_prismatic = joint.type == JointType::kPrismatic;
  const double max = is_prismatic ? kMaxPrismaticPosition : kMaxAngle;
  const char* const unit = is_prismatic ? "m" : "rad";
  if (std::abs(q) <= max) return "";
  return format_text("is %g %s: allowed is up to %g %s", q, unit, max, unit);
}

/// Whether a position is so far outside the joint's limits that it is hardly true: by more than
/// three times the joint's range. A wrong unit does that.
inline bool is_implausible(const Kinematics::Joint& joint, double q) {
  const double range = joint.upper - joint.lower;
  return std::isfinite(range) &&
         std::max(joint.lower - q, q - joint.upper) > std::max(3.0 * range, 1e-3);
}

}  // namespace ist
