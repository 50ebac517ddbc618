// A laser scan: what check_scan() lets pass becomes one point a beam, where the beam ended.
// Covers: src/cloud/format/laser_scan.cpp
// Longest input: 300

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "ist_proximity/cloud/laser_scan.h"
#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;

constexpr double kInf = std::numeric_limits<double>::infinity();

ist::LaserScan scan_from(ByteReader* in, std::vector<float>* ranges) {
  ist::LaserScan scan;
  scan.angle_min = in->number(7.0);
  scan.angle_increment = in->number(0.2);
  scan.time_increment = in->number(0.01);
  scan.range_min = in->number(1.0);
  scan.range_max = in->number(30.0);
  const std::size_t count = in->left() / sizeof(float);
  ranges->resize(count);
  if (count > 0) std::memcpy(ranges->data(), in->rest(), count * sizeof(float));
  scan.ranges = count > 0 ? ranges->data() : nullptr;
  scan.count = count;
  return scan;
}

// The end of a beam, in the sensor's frame at the first one.
Eigen::Vector3d beam_end(const ist::LaserScan& scan, std::size_t i, const Eigen::Isometry3d& X_SE) {
  const double angle = scan.angle_min + static_cast<double>(i) * scan.angle_increment;
  const double range = static_cast<double>(scan.ranges[i]);
  const Eigen::Vector3d p(range * std::cos(angle), range * std::sin(angle), 0.0);
  if (scan.count < 2 || scan.time_increment == 0.0) return p;
  const double t = static_cast<double>(i) / static_cast<double>(scan.count - 1);
  const Eigen::AngleAxisd turn(X_SE.linear());
  return Eigen::AngleAxisd(t * turn.angle(), turn.axis()) * p + t * X_SE.translation();
}

void check_beam(const ist::LaserScan& scan, std::size_t i, double min_range, double max_range,
                const Eigen::Isometry3d& X_SE, const double* xyz) {
  const Eigen::Vector3d p(xyz[0], xyz[1], xyz[2]);
  const double range = static_cast<double>(scan.ranges[i]);
  if (std::isnan(range) || range < scan.range_min) {
    FUZZ_CHECK(p.array().isNaN().any(), "beam %zu of %g m is unknown", i, range);
  } else if (range < kInf && range > (scan.range_max + 1.0) * (1.0 + 1e-6)) {
    FUZZ_CHECK(p.allFinite() && p.norm() > 3e9, "beam %zu of %g m is discarded", i, range);
  } else if (range > scan.range_max) {
    FUZZ_CHECK(p.array().isInf().any() && !p.array().isNaN().any(), "beam %zu of %g m saw nothing",
               i, range);
  } else if (range < min_range) {
    FUZZ_CHECK(p.isZero(), "beam %zu of %g m is too near", i, range);
  } else if (range > max_range) {
    FUZZ_CHECK(p.allFinite() && p.norm() > 1e9, "beam %zu of %g m is out of range", i, range);
  } else {
    const double off = (p - beam_end(scan, i, X_SE)).norm();
    FUZZ_CHECK(off <= 1e-6 * (1.0 + range), "beam %zu of %g m is %g m off", i, range, off);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  Eigen::Isometry3d X_SE = in.pose(0.5);
  const double min_range = in.between(0.0, 1.0), max_range = min_range + in.between(0.01, 20.0);
  std::vector<float> ranges;
  const ist::LaserScan scan = scan_from(&in, &ranges);
  const std::string fault = ist::check_scan(scan);
  if (!fault.empty()) {
    FUZZ_CHECK(fault.back() == '.', "no sentence: %s", fault.c_str());
    return 0;
  }
  FUZZ_CHECK(scan.count > 0 && std::abs(scan.duration()) <= ist::kLongestScan, "%zu beams, %g s",
             scan.count, scan.duration());
  ist::ScanPoints points;
  std::vector<ist::SensorAtBeam> sensor(1);
  if (scan.count > 1) sensor.push_back({scan.count - 1, X_SE});
  ist::to_points(scan, min_range, max_range, sensor, &points);
  FUZZ_CHECK(points.raw().size() == scan.count, "%zu points for %zu beams", points.raw().size(),
             scan.count);
  for (std::size_t i = 0; i < scan.count; ++i) {
    check_beam(scan, i, min_range, max_range, X_SE, points.xyz.data() + 3 * i);
  }
  return 0;
}
