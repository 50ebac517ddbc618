#pragma once

#include <Eigen/Core>
#include <optional>

#include "ball_search.h"
#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {

/// Finds inner balls: near a surface point, about an interior point.
class MedialBallFinder {
 public:
  /// @param bvh     the mesh; must outlive this
  /// @param is_closed  every edge has its partner: no ball can bulge through a hole
  /// @param taken   balls that new ones must not overlap (weights: inner radii), or null: overlap
  ///                is allowed. Must outlive this and may grow.
  MedialBallFinder(const TriangleBvh& bvh, bool is_closed, const BallSearch* taken = nullptr);

  struct InnerBall {
    Eigen::Vector3d center;
    double radius;  ///< [m] 0: nothing fits, the ball is the surface point itself
  };

  /// What is nearest to a point: a triangle's point, or a ball that is taken.
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

  /// A large inner ball that holds the interior point x.
  InnerBall around(const Eigen::Vector3d& x, double slack) const;

  /// The ball, or a smaller one about the same centre that does not bulge through a hole; radius 0
  /// when the centre is outside.
  InnerBall without_bulge(const InnerBall& ball) const;

  /// Whether a way that began inside and crossed no triangle is inside at x: not so if it left
  /// through a hole.
  bool stays_inside(const Eigen::Vector3d& x) const { return is_closed_ || bvh_.is_inside(x); }

  bool is_closed() const { return is_closed_; }
  bool is_disjoint() const { return taken_ != nullptr; }

 private:
  InnerBall along(const Eigen::Vector3d& s, const Eigen::Vector3d& direction, double slack,
                  Eigen::Vector3d* contact) const;
  InnerBall turned(const Eigen::Vector3d& s, const Eigen::Vector3d& direction, double slack) const;
  InnerBall pulled_inside(const Eigen::Vector3d& s, InnerBall ball) const;
  bool is_inner(const InnerBall& ball) const;  // its centre is known to be inside

  const TriangleBvh& bvh_;
  bool is_closed_;
  const BallSearch* taken_;
  double size_;  ///< [m] diagonal of the mesh
};

}  // namespace ist
