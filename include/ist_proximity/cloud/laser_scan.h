#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

/// A planar scan (the members of sensor_msgs/LaserScan): beam i points along
/// angle_min + i * angle_increment about the sensor's z axis, 0 being x.
struct LaserScan {
  double angle_min = 0.0;         ///< [rad] direction of the first beam
  double angle_increment = 0.0;   ///< [rad] from a beam to the next
  double time_increment = 0.0;    ///< [s] between beams; 0: all at once
  double range_min = 0.0;         ///< [m] the least that the sensor can measure
  double range_max = 0.0;         ///< [m] the most that the sensor can measure
  const float* ranges = nullptr;  ///< [m] not owned
  std::size_t count = 0;          ///< beams

  /// [s] from the first beam to the last; negative when the last one comes first in time.
  double duration() const {
    return count > 1 ? static_cast<double>(count - 1) * time_increment : 0.0;
  }
};

/// A scan that takes longer than this is rejected as malformed. [s]
constexpr double kLongestScan = 10.0;

/// The largest scan that is used; a larger one is refused.
struct ScanLimits {
  /// Beams; scanners have up to 36,000 a turn. This bounds time and memory of one scan.
  std::size_t max_beams = 50000;
};

/// @returns an empty string, or one sentence with the faulty member and its value: no beams, or
/// more than allowed; an angle, an increment or a limit that is not finite or makes no sense
/// (range_max may be inf); beams over more than two turns; a scan longer than kLongestScan. Thread
/// safe.
std::string check_scan(const LaserScan& scan, const ScanLimits& limits = {});

/// A pose of the sensor during a scan, and the beam that was measured in it.
struct SensorAtBeam {
  std::size_t beam = 0;  ///< from 0
  /// The sensor's frame at that beam -> at the first one, rigid.
  Eigen::Isometry3d X_SB = Eigen::Isometry3d::Identity();
};

/// A scan as points in the sensor's frame at the first beam.
struct ScanPoints {
  std::vector<double> xyz;    ///< [m] three coordinates a beam
  double beam_angle = 0.0;    ///< [rad] between two beams
  double sensor_moved = 0.0;  ///< [m] the sensor's largest distance from its first place
  RawCloud raw() const;       ///< views xyz: one point a beam, in the scan's order
};

/// Places each beam's end where it was measured: in the sensor's pose at that beam, interpolated
/// between the poses that are given.
///
/// REP 117: +inf means that nothing was there, and becomes an infinite point. So does a range above
/// range_max by at most 1 m, which drivers wrote before that REP. A longer one is discarded, as
/// the REP says, and so is one above `sensor_range`: Ingest counts it as not believed. NaN, -inf
/// (too near to be measured) and ranges below range_min (with some drivers 0 means "no echo") mean
/// nothing, and become NaN points. Ranges outside min_range and max_range become points that Ingest
/// counts as out of range. Ingest must be given no range limits of its own: it would measure
/// distances from the sensor's place at the first beam, which are not ranges.
/// @param scan  checked by check_scan
/// @param min_range, max_range  [m] of the points to keep, bounds included
/// @param sensor  poses by rising beams, from the first beam to the last one; between two poses the
///     sensor moves evenly. Empty, or all beams measured at once: it stands still
/// @param sensor_range  [m] the most that the sensor can measure, beside its own range_max
void to_points(const LaserScan& scan, double min_range, double max_range,
               Span<const SensorAtBeam> sensor, ScanPoints* points,
               double sensor_range = std::numeric_limits<double>::infinity());

}  // namespace ist
