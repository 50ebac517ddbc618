#include "ros/poses/mimic_agreement.h"

#include <cmath>

#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kTurn = 2.0 * M_PI;

bool turns(const Kinematics::Joint& joint) { return joint.type != JointType::kPrismatic; }

// [rad, m] The position that gives a pose; of a joint that turns, within half a turn of 0.
double position_in(const Kinematics::Joint& joint, const Eigen::Isometry3d& X_PC) {
  const Eigen::Isometry3d X_JC = joint.X_PJ.inverse() * X_PC;
  if (!turns(joint)) return joint.axis.dot(X_JC.translation());
  const Eigen::Quaterniond turned(X_JC.linear());
  return std::remainder(2.0 * std::atan2(joint.axis.dot(turned.vec()), turned.w()), kTurn);
}

}  // namespace

std::string why_not_led(const Kinematics& kinematics, std::size_t mimic,
                        const Eigen::Isometry3d& X_source, const Eigen::Isometry3d& X_stated,
                        double tolerance) {
  const Kinematics::Joint& joint = kinematics.joints()[mimic];
  if (joint.type == JointType::kFixed || joint.has_unstated_pose()) return "";
  const Kinematics::Joint& leader = kinematics.joints()[joint.source];
  double source = position_in(leader, X_source), stated = position_in(joint, X_stated);
  const auto led = [&] { return joint.multiplier * source + joint.offset; };
  if (turns(leader)) {
    const double way = joint.multiplier * kTurn;  // of the mimic joint, in a turn of its leader
    const double between = leader.upper - leader.lower;
    if (!(between < kTurn)) {
      if (way != 0.0) source += kTurn * std::round((stated - led()) / way);
    } else {
      source += kTurn * std::round((0.5 * (leader.lower + leader.upper) - source) / kTurn);
    }
  }
  if (turns(joint)) stated -= kTurn * std::round((stated - led()) / kTurn);
  if (std::abs(stated - led()) <= tolerance) return "";
  return format_text("joint '%s' is stated at %.3f, but would be at %.3f as a mimic of joint '%s'",
                     joint.name.c_str(), stated, led(), leader.name.c_str());
}

}  // namespace ist
