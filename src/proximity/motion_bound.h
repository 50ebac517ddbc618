#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "ist_proximity/proximity/time_of_impact.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// How far the points of a link can get in a time, while joints move at constant speeds.
///
/// Joint k turns them at |dq_k| times their distance from its axis, at most that of the link's
/// bounding sphere; joints nearer to the link change that distance no faster than they move the
/// sphere's centre. So after h seconds no point has gone farther than a h + b h^2 / 2.
class MotionBound {
 public:
  /// @param center, radius  [m] of a sphere around the link, in its frame
  MotionBound(const Kinematics& kinematics, const JointMotion& motion, const JointPoses& still,
              std::size_t link, const Eigen::Vector3d& center, double radius);

  /// [s] for which no point of the link gets farther than `distance` [m] from where it is; +inf
  /// when it stands still.
  /// @param X_FL  by link of the kinematics, now
  double time_for(double distance, const std::vector<Eigen::Isometry3d>& X_FL) const;

 private:
  struct Mover {
    std::size_t child;     ///< link
    bool turns;            ///< or slides
    Eigen::Vector3d axis;  ///< unit, in the child link's frame
    double speed;          ///< [rad/s, m/s] >= 0
  };

  std::size_t link_;
  Eigen::Vector3d center_;
  double radius_;
  std::vector<Mover> movers_;
  double slides_ = 0.0;  ///< [m/s] of all that slide
  double growth_ = 0.0;  ///< [m/s^2] b
};

/// Whether, and how fast [rad/s, m/s], the motion moves a joint, mimic joints included.
double joint_speed(const Kinematics::Joint& joint, const JointMotion& motion);

}  // namespace ist
