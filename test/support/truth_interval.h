#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

/// Signed distances of any mesh, closed or not, by brute force in double, with what is uncertain.
namespace ist::test {

/// The smallest signed distance lies from low to high. They differ where a winding number is so
/// near to 0.5 that the library's expansion may decide otherwise.
struct TruthInterval {
  double low = std::numeric_limits<double>::infinity();   ///< [m]
  double high = std::numeric_limits<double>::infinity();  ///< [m]

  void add(const TruthInterval& other);
};

/// [m] of one point in the link's frame.
TruthInterval truth_interval(const LinkGeometry& link, const Eigen::Vector3d& p_L);

/// [m] of the nearest or deepest of the points, which are in the fixed frame.
TruthInterval truth_interval(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
                             const std::vector<Eigen::Vector3d>& points_F);

}  // namespace ist::test
