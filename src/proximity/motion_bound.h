#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/time_of_impact.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// An upper bound of how far any point of a body moves in a time, while joints move at constant
/// speeds: the motion bound of conservative advancement.
///
/// A joint that turns at |dq_k| moves a point at |dq_k| times its distance from the joint's axis,
/// at most the largest distance within the bounding sphere. It makes no difference to where a point
/// ends whether the joints move together or one after the other, from the root on: then each one
/// finds its axis and the point as far apart as they were at the start. So after h seconds no point
/// is farther from where it was than a h, with a the speed at the start.
class MotionBound {
 public:
  /// @param motion          after Kinematics::place_mimics() of both its ends
  /// @param center, radius  [m] the body's bounding sphere, in the body's frame
  /// @param ancestor  a body that this one hangs on: the motion is that in its frame
  MotionBound(const Kinematics& kinematics, const JointMotion& motion, std::size_t body,
              const Eigen::Vector3d& center, double radius, std::size_t ancestor = 0);

  /// [m/s] a: no point of the body is faster now. @param X_FB  by body, now
  double speed(Span<const Eigen::Isometry3d> X_FB) const;

 private:
  struct Mover {
    std::size_t child;     ///< body
    Eigen::Vector3d axis;  ///< unit, in the child body's frame
    double speed;          ///< [rad/s] > 0
  };

  std::size_t body_;
  Eigen::Vector3d center_;
  double radius_;
  std::vector<Mover> movers_;   ///< joints that turn
  double sliding_speed_ = 0.0;  ///< [m/s] sum over the prismatic joints
};

/// The time [s] that a distance [m] takes, a little less to allow for rounding; +inf for a speed of
/// 0.
double time_within(double distance, double speed);

/// How fast [rad/s, m/s] the motion moves a joint, mimic joints included; 0: not at all.
double joint_speed(const Kinematics::Joint& joint, const JointMotion& motion);

}  // namespace ist
