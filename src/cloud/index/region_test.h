#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>

#include "cloud/filters/crop_parameters.h"
#include "cloud/index/block_bounds.h"

namespace ist {

/// The place of a box with respect to the region of interest.
enum class RegionSide { kInside, kOutside, kCrossing };

/// The region of interest in the frame O. Thread safe.
class RegionTest {
 public:
  explicit RegionTest(const CropParameters& crop)
      : center_O_(crop.X_OS * crop.region_center), radius_sq_(crop.region_radius_sq) {}

  RegionSide side_of(const BlockBounds& block) const {
    if (radius_sq_ == std::numeric_limits<double>::infinity()) return RegionSide::kInside;
    double nearest_sq = 0.0, farthest_sq = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double below = static_cast<double>(block.min[i]) - center_O_[i],
                   above = static_cast<double>(block.max[i]) - center_O_[i];
      const double farthest = std::max(-below, above), nearest = std::max({below, -above, 0.0});
      farthest_sq += farthest * farthest;
      nearest_sq += nearest * nearest;
    }
    constexpr double kSlack = 1e-6;  // far more than the rounding of double
    if (farthest_sq * (1.0 + kSlack) <= radius_sq_) return RegionSide::kInside;
    return nearest_sq * (1.0 - kSlack) > radius_sq_ ? RegionSide::kOutside : RegionSide::kCrossing;
  }

 private:
  Eigen::Vector3d center_O_;
  double radius_sq_;  ///< [m^2]
};

}  // namespace ist
