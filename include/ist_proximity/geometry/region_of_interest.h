#pragma once

#include <Eigen/Core>
#include <limits>

namespace ist {

/// A sphere in the fixed frame F. Points outside this sphere are discarded; no link can reach them.
/// Queries check that: the lower bound of a link is at most its distance to the sphere's surface,
/// because obstacles outside are unknown.
struct RegionOfInterest {
  Eigen::Vector3d center_F = Eigen::Vector3d::Zero();       ///< [m] in the fixed frame
  double radius = std::numeric_limits<double>::infinity();  ///< [m] >= 0; inf: all points are kept
};

}  // namespace ist
