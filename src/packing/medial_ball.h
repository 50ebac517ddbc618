#pragma once

#include <Eigen/Core>

#include "ball_search.h"
#include "hole_guard.h"
#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {

/// Finds inner balls: near a surface point, about an interior point.
class MedialBallFinder {
 public:
  /// @param bvh     the mesh; must outlive this
  /// @param holes   the same mesh's; must outlive this; learns from the balls that are asked for
  /// @param taken   balls that new ones must not overlap (weights: inner radii), or null: overlap
  ///                is allowed. Must outlive this and may grow.
  MedialBallFinder(const TriangleBvh& bvh, HoleGuard* holes, const BallSearch* taken = nullptr);

  struct InnerBall {
    Eigen::Vector3d center;
    double radius;  ///< [m] 0: nothing fits, the ball is the surface point itself
  };

  /// What is nearest to a point: a triangle's point, a ball that is taken, or one by a hole.
  struct Obstacle {
    Eigen::Vector3d contact;  ///< the nearest point of it
    Eigen::Vector3d center;   ///< of the ball; a triangle's point is a ball of radius 0
    double radius;            ///< [m]
    double distance;          ///< [m] negative within a ball
  };
  Obstacle nearest(const Eigen::Vector3d& x) const;

  /// A large inner ball that comes within `slack` [m] of the surface point s.
  ///
  /// Of all balls on the inward ray through s, the largest whose gap at s is `slack`: the
  /// shrinking ball of Ma, Bae and Choi (2012) with a gap allowed. Near edges and corners, where
  /// the face's normal is a poor direction, the ray is turned away from the other contact.
  /// @param normal  unit normal of the face at s, either orientation (zero: unknown)
  InnerBall at_surface(const Eigen::Vector3d& s, const Eigen::Vector3d& normal, double slack) const;

  /// A large inner ball that holds the interior point x; where a hole leaves no room for one, a
  /// ball about x whose radius is minus the distance to the mesh.
  InnerBall around(const Eigen::Vector3d& x, double slack) const;

  /// Whether no hole speaks against taking the ball. If one does, another search will find less.
  bool admits(const InnerBall& ball) const { return holes_.admits(ball.center, ball.radius); }

  const HoleGuard& holes() const { return holes_; }
  bool is_closed() const { return holes_.is_closed(); }
  bool is_disjoint() const { return taken_ != nullptr; }

 private:
  InnerBall along(const Eigen::Vector3d& s, const Eigen::Vector3d& direction, double slack,
                  Eigen::Vector3d* contact) const;
  InnerBall turned(const Eigen::Vector3d& s, const Eigen::Vector3d& direction, double slack) const;

  const TriangleBvh& bvh_;
  HoleGuard& holes_;
  const BallSearch* taken_;
  double size_;  ///< [m] diagonal of the mesh
};

}  // namespace ist
