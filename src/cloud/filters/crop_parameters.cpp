#include "cloud/filters/crop_parameters.h"

#include <algorithm>
#include <array>

#include "cloud/format/point_reader.h"
#include "internal/cloud/largest_range.h"
#include "internal/geometry/relative_pose.h"

namespace ist {
namespace {

constexpr double kFarFromSensor = 1000.0;   // [m]
constexpr std::size_t kMiddlePoints = 256;  // points that the middle of a cloud is computed from
constexpr double kAtOrigin = 1e-6;          // [m] nearer than any ray is measured

// The middle of a cloud that is far from its sensor: the median, axis by axis, of some of its
// points in the sensor frame [m]. Zero for other clouds.
Eigen::Vector3d middle_of(const RawCloud& cloud, double min_range_sq, double max_range_sq) {
  std::array<std::array<double, kMiddlePoints>, 3> samples;
  std::size_t count = 0;
  const std::size_t n = cloud.size();
  const std::size_t stride = (n + kMiddlePoints - 1) / kMiddlePoints;
  for (std::size_t i = 0; i < n; i += stride) {
    const Eigen::Vector3d p = point_at(cloud, i / cloud.width, i % cloud.width);
    const double range_sq = p.squaredNorm();
    if (!(range_sq >= min_range_sq && range_sq <= max_range_sq)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      samples[axis][count] = p[static_cast<Eigen::Index>(axis)];
    }
    ++count;
  }
  if (count == 0) return Eigen::Vector3d::Zero();
  Eigen::Vector3d median;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto begin = samples[axis].begin();
    const auto half = static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(begin, begin + half, begin + static_cast<std::ptrdiff_t>(count));
    median[static_cast<Eigen::Index>(axis)] = samples[axis][count / 2];
  }
  return median.norm() > kFarFromSensor ? median : Eigen::Vector3d::Zero();
}

}  // namespace

CropParameters crop_parameters(const RawCloud& cloud, const Eigen::Isometry3d& X_FS,
                               const IngestConfig& config) {
  const double nearest = cloud.from_rays ? std::max(config.min_range, kAtOrigin) : config.min_range;
  const double largest = std::min(config.max_range, kLargestRange);
  const double believed =
      std::min(cloud.believed_range, std::max(config.sensor_range, config.max_range));
  CropParameters crop;
  crop.min_range_sq = nearest * nearest;
  crop.max_range_sq = largest * largest;
  crop.believed_sq = std::min(std::max(believed * believed, crop.max_range_sq), crop.believed_sq);
  Eigen::Vector3d near_S = Eigen::Vector3d::Zero();
  if (config.max_range > kFarFromSensor)
    near_S = middle_of(cloud, crop.min_range_sq, crop.max_range_sq);
  crop.X_FO.translation() = (X_FS * near_S).array().round();
  crop.X_OS = relative_pose(crop.X_FO, X_FS);
  return crop;
}

void limit_to_region(const RegionOfInterest& region, const Eigen::Isometry3d& X_FS,
                     CropParameters* crop) {
  crop->region_center = X_FS.inverse() * region.center_F;
  crop->region_radius_sq = region.radius * region.radius;
}

void set_axes(const Eigen::Matrix3d& R_FO, CropParameters* crop) {
  const Eigen::Matrix3d R_NO = R_FO.transpose() * crop->X_FO.linear();  // from old to new axes
  crop->X_FO.linear() = R_FO;
  crop->X_OS = Eigen::Isometry3d(R_NO) * crop->X_OS;
}

}  // namespace ist
