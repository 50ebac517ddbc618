#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// Linear velocity [m/s] over angular velocity [rad/s], per joint.
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// The geometric Jacobian of a point P that is fixed to a body: with the joints moving at dq
/// [rad/s, m/s], J * dq is the velocity of P in the fixed frame, over the body's angular velocity;
/// and J^T * (force; torque about P) are the joints' efforts [N m, N].
///
/// It needs the bodies' poses alone: a joint's axis is fixed in its child body and goes through
/// that body's origin. No joint position is needed, so poses from tf serve as well.
/// @param X_FB  by body (BodyPoses): body frame -> fixed frame; read for the child bodies of the
///              moving joints between root and `body`, see first_body_needed
/// @param p_FP  [m] in the fixed frame
/// @param J     overwritten; one column per joint of the kinematics. A mimic joint's motion is in
///              the column of the joint that it follows; columns of joints that are not free, or do
///              not move the body, are zero. Planar and floating joints have no column: they count
///              as standing still. Allocates when it has another size than before.
/// Thread safe.
void point_jacobian(const Kinematics& kinematics, Span<const Eigen::Isometry3d> X_FB,
                    std::size_t body, const Eigen::Vector3d& p_FP, Jacobian* J);

/// The body whose pose point_jacobian() would read although it is not known: the nearest to `body`
/// between it and the root, itself included. Empty when all poses that it reads are known.
/// @param known  by body
std::optional<std::size_t> first_body_needed(const Kinematics& kinematics,
                                             const std::vector<bool>& known, std::size_t body);

}  // namespace ist
