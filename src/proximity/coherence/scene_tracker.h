#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// Identifies a scene: two queries with the same id met the same points and boxes, at the same
/// places. kUnknownScene is the id of none.
using SceneId = std::uint64_t;
constexpr SceneId kUnknownScene = 0;

/// Whether both give every point the same radius.
bool same_extent(const PointExtent& a, const PointExtent& b);

/// Tells whether the clouds of a query are those of the query before, by the build ids of their
/// indices, the poses of their maps and the regions of interest. One thread.
class SceneTracker {
 public:
  /// @returns the same id from call to call as long as all clouds stay the same; kUnknownScene
  /// where
  ///          there are more clouds than are remembered
  SceneId identify(SnapshotSpan clouds);

 private:
  struct Cloud {
    std::uint64_t points = 0, boxes = 0;  ///< build ids; 0: there are none
    Eigen::Matrix<double, 3, 4> X_FM = Eigen::Matrix<double, 3, 4>::Zero();  ///< of the boxes
    RegionOfInterest region;
    PointExtent extent;
    double box_extent = 0.0;
  };
  static constexpr std::size_t kMaxClouds = 16;
  static Cloud identity(const CloudSnapshot& cloud);

  std::array<Cloud, kMaxClouds> clouds_;
  std::size_t count_ = 0;
  SceneId id_ = kUnknownScene;
};

}  // namespace ist
