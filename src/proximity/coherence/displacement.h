#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>

#include "ist_proximity/robot/robot_model.h"

/// Temporal coherence: what one query proves serves the next ones.
///
/// The one invariant of this folder: a lower bound b that was proven at a pose X for a scene S
/// holds at a pose X' for the same scene as b - displacement, where no point of the link, or of
/// what the bound is about, moves farther than the displacement between X and X'. A distance
/// changes by no more than the points that it is measured between move (it is 1-Lipschitz), so
/// nothing else is needed. LinkBound, ExtentBound and SearchFront keep such bounds; all of
/// them take displacements from here, where their rounding is accounted for.
///
/// The exception: the inside of a mesh with holes ends where no surface is, so a point may become
/// an inside point although no surface has crossed it, and its signed distance jumps. So a bound of
/// such a link is kept with a margin: every place nearer than that to an obstacle is outside.
/// Unsigned distances do not jump; PointDepth::floor takes the jump in (Solid::depth).
namespace ist {

/// [m] What remains of a bound after a displacement; -inf where the displacement is not known (NaN
/// or infinite).
inline double after_displacement(double bound, double displacement) {
  // Written so that NaN proves nothing.
  return displacement < std::numeric_limits<double>::infinity()
             ? bound - displacement
             : -std::numeric_limits<double>::infinity();
}

/// The box of a link and of all that it encloses, in the link's frame [m].
Eigen::AlignedBox3d bounding_box(const LinkModel& link);

/// How far the points of a link move between two poses.
///
/// The displacement of a point is an affine function of the point, so its length is a convex one:
/// within a box it is largest at a corner.
class DisplacementBound {
 public:
  explicit DisplacementBound(const LinkModel& link);
  /// For the points of a box in the link's frame.
  explicit DisplacementBound(const Eigen::AlignedBox3d& box);

  /// [m] No point of the link, nor of what it encloses, moves farther between the two poses;
  /// rounding included. NaN where either pose is not finite. Thread safe.
  double between(const Eigen::Isometry3d& X_FA, const Eigen::Isometry3d& X_FB) const;

 private:
  Eigen::Vector3d center_, half_;  ///< [m] of bounding_box()
  double extent_;                  ///< [m] no coordinate of the box is larger
};

}  // namespace ist
