#include "ros/poses/position_limits.h"

#include <algorithm>
#include <cmath>

#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kImplausibleRanges = 3.0;

}  // namespace

std::string why_not_a_position(const Kinematics::Joint& joint, double q) {
  if (!std::isfinite(q)) return "is NaN or infinite";
  const bool is_prismatic = joint.type == JointType::kPrismatic;
  const double max = is_prismatic ? kMaxPrismaticPosition : kMaxAngle;
  if (std::abs(q) <= max) return "";
  return format_text("is %g %s: allowed is up to %g %s", q, is_prismatic ? "m" : "rad", max,
                     is_prismatic ? "m" : "rad");
}

bool is_implausible(const Kinematics::Joint& joint, double q) {
  const double range = joint.upper - joint.lower;
  if (!std::isfinite(range)) return false;
  const double outside = std::max(joint.lower - q, q - joint.upper);
  return outside > std::max(kImplausibleRanges * range, 1e-3);
}

}  // namespace ist
