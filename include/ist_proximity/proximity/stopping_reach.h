#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// The motion of a joint, or of a link, until it stands. +inf: not known.
struct StoppingReach {
  double speed = std::numeric_limits<double>::infinity();  ///< [rad/s, m/s] nothing of it is faster
  double distance = std::numeric_limits<double>::infinity();  ///< [rad, m] nothing goes farther
  double time = std::numeric_limits<double>::infinity();      ///< [s]
};

/// Lets all joints brake. One that moves at v and brakes with a or more stands after |v| / a, and
/// v^2 / (2 a) away. A mimic joint moves with the one that it follows, or as is stated where that
/// is more. Of planar and floating joints nothing is known.
/// @param velocities     [rad/s, m/s] by joint of the kinematics; NaN: not known. Read for joints
///                       that can move
/// @param decelerations  [rad/s^2, m/s^2] by joint; 0: not known
/// @param joints         by joint, overwritten; its memory is kept. Not known with other sizes
/// Thread safe.
void brake_joints(const Kinematics& kinematics, Span<const double> velocities,
                  Span<const double> decelerations, std::vector<StoppingReach>* joints);

/// Bounds what a link can reach. A distance that is proven now is left, less `distance`, wherever
/// the joints are on their way: each anywhere between here and where it stands, in any order.
///
/// The joints end at the same place if they move together or one after the other. From the
/// root on, each one finds its axis and the link as far apart as they are now: it carries no point
/// farther than its angle times the largest distance of the link's box from that axis, and a
/// sliding joint no farther than it slides.
/// @param joints  of brake_joints()
/// @param body   of the kinematics; 0, or one that is not there: nothing moves it
/// @param box_B  [m] about the link's geometry, in the body's frame
/// @param X_FB   by body: body frame -> fixed frame; read for the bodies between root and `body`
/// Allocates nothing. Thread safe.
StoppingReach stopping_reach(const Kinematics& kinematics, Span<const StoppingReach> joints,
                             std::size_t body, const Eigen::AlignedBox3d& box_B,
                             Span<const Eigen::Isometry3d> X_FB);

}  // namespace ist
