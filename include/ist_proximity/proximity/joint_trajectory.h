#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace ist {

/// Positions of joints along a time, by waypoint and by joint of the kinematics.
struct JointTrajectory {
  std::vector<double> times;  ///< [s] by waypoint, finite and rising
  /// [rad, m] by waypoint, by joint. NaN at every waypoint: the joint stands still, or follows the
  /// one that it mimics.
  std::vector<std::vector<double>> positions;
  /// [rad/s, m/s] likewise, or empty. With velocities the joints move along cubic polynomials
  /// between waypoints; without, straight at constant speed.
  std::vector<std::vector<double>> velocities;
  /// [rad/s^2, m/s^2] likewise, or empty. With velocities and accelerations the polynomials are
  /// quintic, as in ros_controllers' JointTrajectoryController.
  std::vector<std::vector<double>> accelerations;
};

/// Motions that are straight in joint space, one after another, near to which a trajectory stays.
struct StraightPieces {
  std::vector<double> times;                   ///< [s] where pieces begin, and the end
  std::vector<std::vector<double>> positions;  ///< [rad, m] by time, by joint; on the trajectory
  /// [rad, m] by piece, by joint: the joint is never farther from the straight motion.
  std::vector<std::vector<double>> deviations;
};

/// Cuts the polynomials of a trajectory into straight pieces. A polynomial is no farther from its
/// chord than an eighth of its largest second derivative, which its Bezier points bound.
/// @param trajectory     sizes that agree, and finite but for NaN positions
/// @param max_deviation  [rad, m] wanted; no polynomial is cut into more than 64 pieces for it
/// Thread safe.
StraightPieces straight_pieces(const JointTrajectory& trajectory, double max_deviation = 5e-4);

/// [rad, m] By joint: where the pieces have the joints at a time [s], or at the nearest time that
/// they have. NaN for a joint whose positions are. There is a piece or more. Thread safe.
std::vector<double> positions_at(const StraightPieces& pieces, double time);

/// [s] The most of the trajectory's time that braking along it takes, if it begins at `from` or
/// later and ends by `until`; +inf where a joint's own acceleration exceeds the deceleration.
/// Braking slows time down steadily, as fast as every joint can beside what the trajectory asks of
/// it: it takes twice this long. Thread safe.
/// @param decelerations  [rad/s^2, m/s^2] by joint
double braking_way(const StraightPieces& pieces, double from, double until,
                   const std::vector<double>& decelerations);

/// The proven clearance of a link along a trajectory.
struct LinkClearance {
  /// [s] of the trajectory, never later than the first contact; the first time that was asked for
  /// where there is contact then, +inf without contact, NaN when not known.
  double contact_time = std::numeric_limits<double>::quiet_NaN();
  /// [m] Lower bound of the distance until the end, or until `contact_time`; NaN when not known. At
  /// most the least distance, and less by a quarter of it or 2 mm; by more where a joint's second
  /// derivative is above 16 rad or m, with the time between two waypoints as its unit.
  double lower_bound = std::numeric_limits<double>::quiet_NaN();
  double nearest_time = std::numeric_limits<double>::quiet_NaN();  ///< [s] of the least bound found
  /// False: the search stopped after many steps; the contact, if any, may be much later.
  bool converged = true;
  int steps = 0;  ///< distance queries
  /// [m/rad, 1] The gradient of the distance at `nearest_time`, by joint of Robot::joints(); empty
  /// where the link is in contact or nothing is near. Robot::clearance() alone sets it.
  std::vector<double> gradient;
};

}  // namespace ist
