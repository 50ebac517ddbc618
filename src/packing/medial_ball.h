#pragma once

#include <Eigen/Core>
#include <optional>

#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {

/// Finds inner balls near a surface point.
class MedialBallFinder {
 public:
  /// @param bvh     the mesh; must outlive this
  /// @param is_closed  every edge has its partner: no ball can bulge through a hole
  MedialBallFinder(const TriangleBvh& bvh, bool is_closed);

  struct InnerBall {
    Eigen::Vector3d center;
    double radius;  ///< [m] 0: nothing fits, the ball is the surface point itself
  };

  /// A large inner ball that comes within `slack` [m] of the surface point s.
  ///
  /// Of all balls on the inward ray through s, the largest whose gap at s is `slack`: the
  /// shrinking ball of Ma, Bae and Choi (2012) with a gap allowed. Near edges and corners, where
  /// the face's normal is a poor direction, the ray is turned away from the other contact.
  /// @param normal  unit normal of the face at s, either orientation (zero: unknown)
  InnerBall at_surface(const Eigen::Vector3d& s, const Eigen::Vector3d& normal, double slack) const;

  /// A large inner ball that holds the interior point x.
  InnerBall around(const Eigen::Vector3d& x, double slack) const;

  bool is_closed() const { return is_closed_; }

 private:
  InnerBall along(const Eigen::Vector3d& s, const Eigen::Vector3d& direction, double slack,
                  Eigen::Vector3d* contact) const;
  InnerBall turned(const Eigen::Vector3d& s, const Eigen::Vector3d& direction, double slack) const;
  InnerBall pulled_inside(const Eigen::Vector3d& s, InnerBall ball) const;
  bool is_inner(const InnerBall& ball) const;  // its centre is known to be inside

  const TriangleBvh& bvh_;
  bool is_closed_;
  double size_;  ///< [m] diagonal of the mesh
};

}  // namespace ist
