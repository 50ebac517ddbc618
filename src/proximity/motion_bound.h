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
/// at most the largest distance within the bounding sphere. Joints nearer to the body change that
/// distance no faster than they move the sphere's centre. So after h seconds no point has moved
/// farther than a h + b h^2 / 2, with a the speed at the start and b the growth of that speed.
class MotionBound {
 public:
  /// @param motion          after place_mimics()
  /// @param center, radius  [m] the body's bounding sphere, in the body's frame
  /// @param ancestor  a body that this one hangs on: the motion is that in its frame
  MotionBound(const Kinematics& kinematics, const JointMotion& motion, const JointPoses& still,
              std::size_t body, const Eigen::Vector3d& center, double radius,
              std::size_t ancestor = 0);

  /// The time [s] during which no point of the body moves farther than `distance` [m]; +inf when
  /// the body stands still.
  /// @param X_FB  by body, now
  double time_for(double distance, Span<const Eigen::Isometry3d> X_FB) const;

  /// [m/s] a: no point of the body is faster now. @param X_FB  by body, now
  double speed(Span<const Eigen::Isometry3d> X_FB) const;
  double growth() const { return growth_; }  ///< [m/s^2] b

 private:
  struct Mover {
    std::size_t child;     ///< body
    bool turns;            ///< false: the joint slides
    Eigen::Vector3d axis;  ///< unit, in the child body's frame
    double speed;          ///< [rad/s, m/s] >= 0
  };

  std::size_t body_;
  Eigen::Vector3d center_;
  double radius_;
  std::vector<Mover> movers_;
  double sliding_speed_ = 0.0;  ///< [m/s] sum over the prismatic joints
  double growth_ = 0.0;         ///< [m/s^2] b
};

/// The time [s] until speed h + growth h^2 / 2 is `distance` [m], a little less to allow for
/// rounding; +inf for a speed of 0.
double time_within(double distance, double speed, double growth);

/// Sets the positions of mimic joints that follow, which the functions here read.
void place_mimics(const Kinematics& kinematics, JointMotion* motion);

/// How fast [rad/s, m/s] the motion moves a joint, mimic joints included; 0: not at all.
double joint_speed(const Kinematics::Joint& joint, const JointMotion& motion);

}  // namespace ist
