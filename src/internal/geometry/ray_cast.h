#pragma once

#include <Eigen/Core>
#include <limits>

#include "ist_proximity/geometry/solid.h"

namespace ist {

/// The point where a ray first meets a surface.
struct RayHit {
  double t = std::numeric_limits<double>::infinity();  ///< parameter of the ray; inf: it misses
  /// Unit normal of the surface there, on the side that the ray comes from.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

/// Finds the smallest t in [0, max_t] at which origin + t direction lies on the surface of one of
/// the solid's elements, also where another element covers it. The sides of a surface are equal: a
/// ray that begins inside meets the surface from within. Edges have no gaps: a ray that meets a
/// closed mesh through an edge or a corner is not lost. Thread safe; allocates nothing.
/// @param origin_L     [m] link frame
/// @param direction_L  of any length but 0
RayHit ray_cast(const Solid& solid, const Eigen::Vector3d& origin_L,
                const Eigen::Vector3d& direction_L,
                double max_t = std::numeric_limits<double>::infinity());

/// The nearest approach of a ray to a solid that it misses.
struct RayApproach {
  double distance = std::numeric_limits<double>::infinity();  ///< [m] from the ray to the surface
  double t = 0.0;  ///< parameter of the ray at its nearest point
};

/// Finds the nearest approach of a ray to the surface near one of its points, by a few steps of the
/// secant rule. The distance is that of a point of the ray, and so never below the ray's; where the
/// surface is convex it is close to it.
/// @param t             parameter of the point that the search begins at
/// @param max_distance  [m] a surface farther than this from that point is not found
RayApproach nearest_approach(const Solid& solid, const Eigen::Vector3d& origin_L,
                             const Eigen::Vector3d& direction_L, double t, double max_distance);

}  // namespace ist
