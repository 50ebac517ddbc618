#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>

#include "internal/geometry/solid_queries.h"

namespace ist {

/// A plane that a link lies below, in the link's frame: no point x of it has a larger normal.x than
/// `support`. It is kept while the direction to the closest obstacle is nearly the same.
struct SupportingPlane {
  Eigen::Vector3d normal_L = Eigen::Vector3d::Zero();  ///< unit; zero: there is no plane
  double support = 0.0;                                ///< [m]

  /// Chooses the plane across the direction of the closest obstacle, which touches the link where
  /// it ends in that direction. Where the link is convex there, it touches the closest point, and
  /// what lies beyond the obstacle's own plane is farther.
  /// @param closest  of an obstacle
  /// @returns whether the plane has changed
  bool turn_to(const Solid& solid, const SignedDistance& closest) {
    // Directions this close [rad] serve as one: 5 cm off the axis that makes 0.5 mm.
    constexpr double kSameDirection = 0.01;
    // [m] The plane may be this much too far.
    constexpr double kSupportSlack = 1e-5;
    if (!(closest.distance > 0.0) || closest.distance == std::numeric_limits<double>::infinity() ||
        !((closest.normal - normal_L).squaredNorm() > kSameDirection * kSameDirection)) {
      return false;
    }
    normal_L = closest.normal;
    support = ist::support(solid, normal_L, kSupportSlack, normal_L.dot(closest.witness));
    return true;
  }
};

}  // namespace ist
