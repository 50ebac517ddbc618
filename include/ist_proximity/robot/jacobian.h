#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <vector>

#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// Linear velocity [m/s] over angular velocity [rad/s], per joint.
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// The geometric Jacobian of a point P that is fixed to a link: with the joints moving at dq
/// [rad/s, m/s], J * dq is the velocity of P in the fixed frame, over the link's angular velocity;
/// and J^T * (force; torque about P) are the joints' efforts [N m, N].
///
/// From the links' poses alone: a joint's axis is fixed in its child link and goes through that
/// link's origin. No joint position is needed, so poses from tf serve as well.
/// @param X_FL  by link of the kinematics: link -> fixed frame; read for the child links of the
///              moving joints on the way to `link`, see first_link_needed
/// @param p_FP  [m] in the fixed frame
/// @param J     overwritten; one column per joint of the kinematics. What a mimic joint moves is in
///              the column of the joint that it follows; columns of joints that are not free, or do
///              not move the link, are zero. Planar and floating joints have no column: they count
///              as standing still. Allocates when it has another size than before.
/// Thread safe.
void point_jacobian(const Kinematics& kinematics, const std::vector<Eigen::Isometry3d>& X_FL,
                    std::size_t link, const Eigen::Vector3d& p_FP, Jacobian* J);

/// Whose pose point_jacobian() would read although it is not known: the link nearest to `link` on
/// its way to the root, itself included. Empty: all is known.
/// @param known  by link of the kinematics
std::optional<std::size_t> first_link_needed(const Kinematics& kinematics,
                                             const std::vector<bool>& known, std::size_t link);

}  // namespace ist
