#pragma once

#include <Eigen/Core>

#include "hole_obstacles.h"
#include "internal/geometry/triangle_bvh.h"
#include "sphere_search.h"

namespace ist {

/// A sphere inside the mesh that a packing may take. Its centre lies near the medial axis.
struct MedialSphere {
  Eigen::Vector3d center;  ///< [m]
  double radius;  ///< [m] 0: a surface point that no sphere fits to. Negative: see containing()
};

/// Finds large inner spheres: near a surface point, or about an interior point.
class MedialSphereFinder {
 public:
  /// @param bvh    of the mesh; must outlive this
  /// @param holes  of the same mesh; must outlive this; admits() adds obstacles to it
  /// @param taken  spheres that new ones must not overlap (weights: inner radii), or null: overlap
  ///               is allowed. Must outlive this and may grow.
  MedialSphereFinder(const TriangleBvh& bvh, HoleObstacles* holes,
                     const SphereSearch* taken = nullptr);

  /// A triangle, a taken sphere or a hole obstacle, as its nearest point is seen from a point x.
  struct Obstacle {
    Eigen::Vector3d contact;  ///< [m] the obstacle's point nearest to x
    Eigen::Vector3d center;   ///< [m] of the sphere; a triangle counts as a sphere of radius 0
    double radius;            ///< [m]
    double distance;          ///< [m] from x; negative within a sphere
  };
  /// The obstacle nearest to x. Its distance is the clearance of x.
  Obstacle nearest(const Eigen::Vector3d& x) const;

  /// A large inner sphere that comes within `gap` [m] of the surface point s.
  ///
  /// The largest sphere centred on the inward ray through s whose distance to s is `gap`: the
  /// shrinking ball algorithm (Ma, Bae and Choi 2012) with a gap allowed. Near edges and corners,
  /// where the face's normal is a poor direction, the ray is turned away from the other contact.
  /// @param normal  unit normal of the face at s, in either orientation (zero: unknown)
  MedialSphere near_surface(const Eigen::Vector3d& s, const Eigen::Vector3d& normal,
                            double gap) const;

  /// A large inner sphere that contains the interior point x. Where a hole admits none, the result
  /// has the centre x and minus the distance to the mesh as its radius.
  MedialSphere containing(const Eigen::Vector3d& x, double gap) const;

  /// Whether the sphere keeps away from the mesh's holes. If it does not, its opening becomes an
  /// obstacle, so another search finds a smaller sphere.
  bool admits(const MedialSphere& sphere) const {
    return holes_.admits(sphere.center, sphere.radius);
  }

  const HoleObstacles& holes() const { return holes_; }
  bool is_closed() const { return holes_.is_closed(); }
  bool is_disjoint() const { return taken_ != nullptr; }

 private:
  MedialSphere shrink_along(const Eigen::Vector3d& direction, const Eigen::Vector3d& s, double gap,
                            Eigen::Vector3d* contact) const;
  MedialSphere best_direction(const Eigen::Vector3d& s, const Eigen::Vector3d& direction,
                              double gap) const;

  const TriangleBvh& bvh_;
  HoleObstacles& holes_;
  const SphereSearch* taken_;
  double size_;  ///< [m] diagonal of the mesh's box
};

}  // namespace ist
