#include "ist_proximity/robot/kinematics.h"

#include <limits>

namespace ist {
namespace {

bool moves(const Kinematics::Joint& joint) {
  return joint.type != JointType::kFixed && !joint.has_unstated_pose();
}

}  // namespace

void point_jacobian(const Kinematics& kinematics, Span<const Eigen::Isometry3d> X_FB,
                    std::size_t body, const Eigen::Vector3d& p_FP, Jacobian* J) {
  const auto& joints = kinematics.joints();
  J->setZero(6, static_cast<Eigen::Index>(joints.size()));
  if (X_FB.size() != kinematics.bodies().size() || body >= X_FB.size()) {
    J->setConstant(std::numeric_limits<double>::quiet_NaN());
    return;
  }
  for (std::size_t at = body; at > 0; at = joints[at - 1].parent) {
    const Kinematics::Joint& joint = joints[at - 1];
    if (!moves(joint)) continue;
    const Eigen::Vector3d axis_F = joint.multiplier * (X_FB[at].linear() * joint.axis);
    auto column = J->col(static_cast<Eigen::Index>(joint.source));
    if (joint.type == JointType::kPrismatic) {
      column.head<3>() += axis_F;
    } else {
      column.head<3>() += axis_F.cross(p_FP - X_FB[at].translation());
      column.tail<3>() += axis_F;
    }
  }
}

std::optional<std::size_t> first_body_needed(const Kinematics& kinematics,
                                             const std::vector<bool>& known, std::size_t body) {
  const auto& joints = kinematics.joints();
  if (known.size() != kinematics.bodies().size() || body >= known.size()) return body;
  for (std::size_t at = body; at > 0; at = joints[at - 1].parent) {
    if (!known[at] && (at == body || moves(joints[at - 1]))) return at;
  }
  return std::nullopt;
}

}  // namespace ist
