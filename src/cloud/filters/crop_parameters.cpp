#include "cloud/filters/crop_parameters.h"

#include <algorithm>
#include <array>

#include "cloud/format/point_reader.h"
#include "internal/geometry/relative_pose.h"

namespace ist {
namespace {

constexpr double kFarFromSensor = 1000.0;  // [m]
constexpr std::size_t kSamples = 256;      // points that the middle of a cloud is made of

// Where a cloud is that does not lie about its sensor: the median, axis by axis, of some of its
// points. In the sensor frame [m]; zero where the cloud is about its sensor.
Eigen::Vector3d middle_of(const RawCloud& cloud, double min_range_sq, double max_range_sq) {
  std::array<std::array<double, kSamples>, 3> samples;
  std::size_t count = 0;
  const std::size_t n = cloud.size();
  const std::size_t stride = (n + kSamples - 1) / kSamples;
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

CropParameters crop_parameters(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, double min_range,
                   double max_range) {
  const double largest = std::min(max_range, kLargestRange);
  CropParameters pose;
  pose.min_range_sq = min_range * min_range;
  pose.max_range_sq = largest * largest;
  Eigen::Vector3d near_S = Eigen::Vector3d::Zero();
  if (max_range > kFarFromSensor) near_S = middle_of(cloud, pose.min_range_sq, pose.max_range_sq);
  pose.X_FO.translation() = (X_FS * near_S).array().round();
  pose.X_OS = relative_pose(pose.X_FO, X_FS);
  return pose;
}

void limit(const RegionOfInterest& region, const Eigen::Isometry3d& X_FS, CropParameters* pose) {
  pose->region_center = X_FS.inverse() * region.center_F;
  pose->region_radius_sq = region.radius * region.radius;
}

void turn(const Eigen::Matrix3d& R_FO, CropParameters* pose) {
  const Eigen::Matrix3d R_NO = R_FO.transpose() * pose->X_FO.linear();
  pose->X_FO.linear() = R_FO;
  pose->X_OS = Eigen::Isometry3d(R_NO) * pose->X_OS;
}

}  // namespace ist
