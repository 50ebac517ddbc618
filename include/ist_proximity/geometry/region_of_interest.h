#pragma once

#include <Eigen/Core>
#include <limits>

namespace ist {

/// A sphere beyond which points are not kept, because no link ever gets so near to them that they
/// count. Queries check it: a link that does get there does not know what is beyond.
struct RegionOfInterest {
  Eigen::Vector3d center_F = Eigen::Vector3d::Zero();       ///< [m] in the fixed frame
  double radius = std::numeric_limits<double>::infinity();  ///< [m] >= 0
};

}  // namespace ist
