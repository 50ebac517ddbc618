#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/morton_order.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/raw_cloud.h"

namespace ist {

/// No sensor sees farther; what claims to be beyond is out of range whatever the configuration.
/// Keeps coordinates far below kFarAway.
constexpr double kLargestRange = 1e9;  // [m]

/// Which points of a cloud to keep, and where they go.
struct CropPose {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< [m] in the fixed frame
  Eigen::Isometry3d X_OS;  ///< sensor frame -> the fixed frame's axes at the origin
  double min_range_sq = 0.0, max_range_sq = 0.0;  ///< [m^2] of the points kept, bounds included
};

/// The origin, on whole metres, is the sensor's own position, unless most points are more than a
/// kilometre from it (a cloud that comes in a map's coordinates with a sensor frame to match); then
/// it is their middle. Either way it is subtracted before double becomes float, so that what is
/// within 100 m of the origin is off by less than 0.01 mm.
/// @param cloud      checked by check_layout
/// @param X_FS       sensor frame -> fixed frame, rigid and finite
/// @param min_range, max_range  [m] of the points kept, bounds included
CropPose crop_pose(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, double min_range,
                   double max_range);

/// Points that are read at a time: they fit the first-level cache.
constexpr std::size_t kCropBlock = 256;

/// Coordinates of a block [m], from the origin along the fixed frame's axes. Where `x` is NaN, the
/// point is to be dropped; its y and z have no meaning.
struct alignas(64) CropBlock {
  float x[kCropBlock], y[kCropBlock], z[kCropBlock];
};

/// Reads some points of one row from the message's bytes, moves them to the fixed frame in double,
/// and counts `not_a_number` and `infinite`.
/// @param count  at most kCropBlock
/// @returns how many are kept
std::size_t crop_points(const RawCloud& cloud, std::size_t row, std::size_t column,
                        std::size_t count, const CropPose& pose, CropBlock* block,
                        IngestCounts* counts);

constexpr std::size_t kPatchSide = 16;  ///< pixels; a patch is a block

/// The same for a square of an image: the pixel in row r and column c of it goes to slot
/// 16 r + c. Pixels beyond the image's edges are dropped, and count for nothing.
/// @param row, column  of the first pixel
std::size_t crop_patch(const RawCloud& cloud, std::size_t row, std::size_t column,
                       const CropPose& pose, CropBlock* block, IngestCounts* counts);

/// Reads a message's bytes once: drops what is not finite or not in range, and counts
/// `not_a_number` and `infinite`.
/// @param points  relative to the origin, along the fixed frame's axes; the id is the number of the
///                point in the message. Grows to more than are kept, and never shrinks
/// @returns how many are kept
std::size_t crop(const RawCloud& cloud, const CropPose& pose, std::vector<CloudPoint>* points,
                 IngestCounts* counts);

}  // namespace ist
