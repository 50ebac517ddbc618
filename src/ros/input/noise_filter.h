#pragma once

#include <cstdint>
#include <memory>

#include "ist_proximity/cloud/ingest.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// Drops isolated points, as depth cameras see them at edges ("flying pixels"), by PCL's radius
/// outlier removal on the cloud as the sensor sent it.
///
/// A dropped point is no obstacle any more, and no bound takes it into account: a thin thing far
/// from the camera (a wire, a finger) can have too few points and vanish. The filter costs a k-d
/// tree and one search per point in the source's thread, far more than the rest of the ingest.
///
/// The filter keeps its memory from cloud to cloud. Not thread safe.
class NoiseFilter {
 public:
  explicit NoiseFilter(const NoiseFilterConfig& config);
  ~NoiseFilter();

  /// @param cloud      checked by check_layout
  /// @param max_range  [m] from the sensor: farther points stay as they are and are no neighbors
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
