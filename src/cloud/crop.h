#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/raw_cloud.h"

namespace ist {

/// The points of a cloud that are finite and in range, in the fixed frame.
struct CroppedCloud {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< [m] in the fixed frame
  std::vector<float> x, y, z;     ///< [m] from the origin along the fixed frame's axes
  std::vector<std::uint32_t> id;  ///< index of the point in the message
  std::size_t size = 0;           ///< points; the vectors may be longer
};

/// No sensor sees farther; what claims to be beyond is out of range whatever the configuration.
/// Keeps coordinates far below kFarAway.
constexpr double kLargestRange = 1e9;  // [m]

/// Reads a message's bytes once: drops what is not finite or not in range, moves the rest to the
/// fixed frame in double, and counts `received`, `not_a_number`, `infinite` and `out_of_range`.
///
/// The origin, on whole metres, is the sensor's own position, unless most points are more than a
/// kilometre from it (a cloud that comes in a map's coordinates with a sensor frame to match); then
/// it is their middle. Either way it is subtracted before double becomes float, so that what is
/// within 100 m of the origin is off by less than 0.01 mm.
/// @param cloud      checked by check_layout
/// @param X_FS       sensor frame -> fixed frame, rigid and finite
/// @param min_range, max_range  [m] of the points kept, bounds included
void crop(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, double min_range, double max_range,
          CroppedCloud* cropped, IngestCounts* counts);

}  // namespace ist
