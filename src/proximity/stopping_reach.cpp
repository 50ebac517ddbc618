#include "ist_proximity/proximity/stopping_reach.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// The share by which sums are taken larger than they are computed.
constexpr double kRounding = 1e-9;

/// [m] The largest distance of a box from the axis of a joint.
double lever_of(const Eigen::Vector3d& axis_C, const Eigen::Isometry3d& X_CB,
                const Eigen::AlignedBox3d& box_B) {
  double lever = X_CB.translation().cross(axis_C).norm();  // of the body's origin
  for (int k = 0; k < 8 && !box_B.isEmpty(); ++k) {
    const Eigen::Vector3d p_CP =
        X_CB * box_B.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
    lever = std::max(lever, p_CP.cross(axis_C).norm());
  }
  return lever;
}

StoppingReach scaled(const StoppingReach& reach, double factor) {
  if (factor == 0.0) return {0.0, 0.0, 0.0};
  return {factor * reach.speed, factor * reach.distance, reach.time};
}

/// A joint that moves at v and brakes with `a`.
StoppingReach braking(double v, double a) {
  StoppingReach reach;
  if (std::isnan(v)) return reach;
  reach.speed = std::abs(v);
  if (v == 0.0) reach.distance = reach.time = 0.0;
  if (v == 0.0 || !(a > 0.0)) return reach;
  reach.distance = 0.5 * v * v / a;
  reach.time = reach.speed / a;
  return reach;
}

StoppingReach larger(const StoppingReach& a, const StoppingReach& b) {
  return {std::max(a.speed, b.speed), std::max(a.distance, b.distance), std::max(a.time, b.time)};
}

}  // namespace

void brake_joints(const Kinematics& kinematics, Span<const double> velocities,
                  Span<const double> decelerations, std::vector<StoppingReach>* joints) {
  const std::size_t count = kinematics.joints().size();
  joints->assign(count, StoppingReach());
  if (velocities.size() != count || decelerations.size() != count) return;
  for (std::size_t j = 0; j < count; ++j) {
    const Kinematics::Joint& joint = kinematics.joints()[j];
    if (joint.has_unstated_pose()) continue;
    (*joints)[j] = {0.0, 0.0, 0.0};
    if (joint.type == JointType::kFixed) continue;
    if (joint.leader == j || !std::isnan(velocities[j])) {
      (*joints)[j] = braking(velocities[j], decelerations[j]);
    }
  }
  for (const std::size_t j : kinematics.mimics()) {
    const Kinematics::Joint& joint = kinematics.joints()[j];
    (*joints)[j] =
        larger((*joints)[j], scaled((*joints)[joint.leader], std::abs(joint.mimic.multiplier)));
  }
}

StoppingReach stopping_reach(const Kinematics& kinematics, Span<const StoppingReach> joints,
                             std::size_t body, const Eigen::AlignedBox3d& box_B,
                             Span<const Eigen::Isometry3d> X_FB) {
  StoppingReach reach{0.0, 0.0, 0.0};
  if (body >= X_FB.size()) return reach;
  for (std::size_t at = body; at != 0; at = kinematics.joints()[at - 1].parent) {
    const StoppingReach& joint = joints[at - 1];
    if (joint.speed == 0.0 && joint.distance == 0.0) continue;
    const Kinematics::Joint& moved = kinematics.joints()[at - 1];
    const bool slides = moved.type == JointType::kPrismatic;
    const double lever =
        slides ? 1.0 : lever_of(moved.axis, X_FB[at].inverse() * X_FB[body], box_B);
    const StoppingReach part = scaled(joint, (1.0 + kRounding) * lever);
    reach.speed += part.speed;
    reach.distance += part.distance;
    reach.time = std::max(reach.time, joint.time);
  }
  return reach;
}

}  // namespace ist
