#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Radius outlier removal: points with too few neighbors are taken for noise.
struct NoiseFilterConfig {
  double radius = 0.0;  ///< [m] >= 0: neighbors are at most this far away; 0: no filter
  int neighbors = 4;    ///< > 0: a point needs this many neighbors
};

/// Drops isolated points, as depth cameras see them at edges ("flying pixels"), from the cloud as
/// the sensor sent it.
///
/// A dropped point is no obstacle any more, and no bound takes it into account: a thin thing far
/// from the camera (a wire, a finger) can have too few points and vanish.
///
/// Most points have their neighbors beside them in the message and need no search. For the others
/// the points are indexed, and each is searched for. Distances are compared in double. The points
/// that are dropped are those that PCL's RadiusOutlierRemoval drops; benchmark/pcl.cpp has the
/// times.
///
/// The filter keeps its memory from cloud to cloud. Not thread safe.
class NoiseFilter {
 public:
  /// @param config  radius > 0, neighbors > 0
  explicit NoiseFilter(const NoiseFilterConfig& config);
  ~NoiseFilter();

  /// @param cloud      checked by check_layout or check_depth_image
  /// @param max_range  [m] from the sensor: farther points stay as they are; they are neighbors,
  /// too
  /// @param dropped    number of finite points within the range that were taken for noise
  /// @returns the same points in the same order, with NaN for dropped ones; valid until the next
  ///          call
  /// @throws std::bad_alloc
  RawCloud run(const RawCloud& cloud, double max_range, std::uint32_t* dropped);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
