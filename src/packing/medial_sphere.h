#pragma once

#include <Eigen/Core>

#include "hole_guard.h"
#include "internal/geometry/triangle_bvh.h"
#include "sphere_search.h"

namespace ist {

/// Finds inner spheres: near a surface point, about an interior point.
class MedialSphereFinder {
 public:
  /// @param bvh     the mesh; must outlive this
  /// @param holes   the same mesh's; must outlive this; learns from the spheres that are asked for
  /// @param taken   spheres that new ones must not overlap (weights: inner radii), or null: overlap
  ///                is allowed. Must outlive this and may grow.
  MedialSphereFinder(const TriangleBvh& bvh, HoleGuard* holes, const SphereSearch* taken = nullptr);

  struct InnerSphere {
    Eigen::Vector3d center;
    double radius;  ///< [m] 0: nothing fits, the sphere is the surface point itself
  };

  /// What is nearest to a point: a triangle's point, a sphere that is taken, or one by a hole.
  struct Obstacle {
    Eigen::Vector3d contact;  ///< the nearest point of it
    Eigen::Vector3d center;   ///< of the sphere; a triangle's point is a sphere of radius 0
    double radius;            ///< [m]
    double distance;          ///< [m] negative within a sphere
  };
  Obstacle nearest(const Eigen::Vector3d& x) const;

  /// A large inner sphere that comes within `slack` [m] of the surface point s.
  ///
  /// Of all spheres on the inward ray through s, the largest whose gap at s is `slack`: the
  /// shrinking sphere of Ma, Bae and Choi (2012) with a gap allowed. Near edges and corners, where
  /// the face's normal is a poor direction, the ray is turned away from the other contact.
  /// @param normal  unit normal of the face at s, either orientation (zero: unknown)
  InnerSphere at_surface(const Eigen::Vector3d& s, const Eigen::Vector3d& normal,
                         double slack) const;

  /// A large inner sphere that holds the interior point x; where a hole leaves no room for one, a
  /// sphere about x whose radius is minus the distance to the mesh.
  InnerSphere around(const Eigen::Vector3d& x, double slack) const;

  /// Whether no hole speaks against taking the sphere. If one does, another search will find less.
  bool admits(const InnerSphere& sphere) const {
    return holes_.admits(sphere.center, sphere.radius);
  }

  const HoleGuard& holes() const { return holes_; }
  bool is_closed() const { return holes_.is_closed(); }
  bool is_disjoint() const { return taken_ != nullptr; }

 private:
  InnerSphere along(const Eigen::Vector3d& s, const Eigen::Vector3d& direction, double slack,
                    Eigen::Vector3d* contact) const;
  InnerSphere turned(const Eigen::Vector3d& s, const Eigen::Vector3d& direction,
                     double slack) const;

  const TriangleBvh& bvh_;
  HoleGuard& holes_;
  const SphereSearch* taken_;
  double size_;  ///< [m] diagonal of the mesh
};

}  // namespace ist
