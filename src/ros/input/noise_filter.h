#pragma once

#include <cstdint>
#include <memory>

#include "ist_proximity/cloud/cloud_layout.h"

namespace ist {

/// Which points of a cloud are taken for noise.
struct NoiseFilterConfig {
  double radius = 0.0;  ///< [m] >= 0: within this, a point needs company; 0: no filter
  int neighbors = 4;    ///< > 0: how many other points that takes
};

/// Whether this build has the filter: it is PCL's.
bool has_noise_filter();

/// Drops points with little about them, as depth cameras see at edges ("flying pixels"), by PCL's
/// radius outlier removal on the cloud as the sensor sent it.
///
/// What it drops is no obstacle any more, and no bound speaks of it: a thin thing far from the
/// camera (a wire, a finger) can have too few points and vanish. It costs a k-d tree and one search
/// per point, far more than all the rest of the ingest, in the source's thread.
///
/// Keeps its memory. Not thread safe.
class NoiseFilter {
 public:
  explicit NoiseFilter(const NoiseFilterConfig& config);
  ~NoiseFilter();

  /// @param cloud      checked by check_layout
  /// @param max_range  [m] from the sensor: points beyond are left as they are, and are no company
  /// @param dropped    number of finite points within the range that were taken for noise
  /// @returns the same points in the same order, those dropped NaN; valid until the next call
  /// @throws std::bad_alloc
  RawCloud run(const RawCloud& cloud, double max_range, std::uint32_t* dropped);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
