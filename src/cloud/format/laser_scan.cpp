#include "ist_proximity/cloud/laser_scan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "internal/cloud/largest_range.h"

namespace ist {
namespace {

constexpr double kTwoTurns = 12.6;  // [rad] and a little more
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string fault(const char* member, double value, const char* expected) {
  std::ostringstream text;
  text << member << " is " << value << ", " << expected << ".";
  return text.str();
}

enum class Beam { kHit, kNothing, kUnknown, kOutOfRange };

Beam judge(const LaserScan& scan, double range, double min_range, double max_range) {
  if (!(range >= scan.range_min)) return Beam::kUnknown;  // NaN and -inf too
  if (range > scan.range_max || range == kInfinity) return Beam::kNothing;
  return range < min_range || range > max_range ? Beam::kOutOfRange : Beam::kHit;
}

}  // namespace

std::string check_scan(const LaserScan& scan, const ScanLimits& limits) {
  if (scan.count == 0) return "ranges is empty, a scan has at least one beam.";
  if (scan.ranges == nullptr) return "ranges is null.";
  if (scan.count > std::numeric_limits<std::uint32_t>::max()) {
    return "ranges holds more beams than 32 bits can number.";
  }
  if (scan.count > limits.max_beams) {
    return "ranges holds " + std::to_string(scan.count) + " beams, allowed are at most " +
           std::to_string(limits.max_beams) + " (max_beams).";
  }
  if (!(std::abs(scan.angle_min) <= kTwoTurns)) {
    return fault("angle_min", scan.angle_min, "it must be an angle in rad");
  }
  const double beams = static_cast<double>(scan.count);
  if (!std::isfinite(scan.angle_increment) || (scan.angle_increment == 0.0 && scan.count > 1)) {
    return fault("angle_increment", scan.angle_increment, "it must be an angle in rad and not 0");
  }
  if (std::abs(scan.angle_increment) * (beams - 1) > kTwoTurns) {
    return fault(
        "angle_increment", scan.angle_increment,
        ("with " + std::to_string(scan.count) + " beams that is more than two turns").c_str());
  }
  if (!(scan.range_min >= 0.0) || !std::isfinite(scan.range_min)) {
    return fault("range_min", scan.range_min, "it must be 0 m or more");
  }
  if (!(scan.range_max > scan.range_min)) {
    return fault("range_max", scan.range_max, "it must be more than range_min");
  }
  if (!std::isfinite(scan.time_increment)) {
    return fault("time_increment", scan.time_increment, "it must be finite");
  }
  if (std::abs(scan.duration()) > kLongestScan) {
    return fault("time_increment", scan.time_increment,
                 ("with " + std::to_string(scan.count) + " beams that is more than 10 s").c_str());
  }
  return {};
}

RawCloud ScanPoints::raw() const {
  RawCloud cloud = packed_cloud(xyz.data(), xyz.size() / 3, 1);
  cloud.pixel_angle = beam_angle;
  return cloud;
}

void to_points(const LaserScan& scan, double min_range, double max_range,
               const Eigen::Isometry3d& X_SE, ScanPoints* points) {
  points->beam_angle = std::abs(scan.angle_increment);
  const bool moves = scan.count > 1 && scan.time_increment != 0.0;
  const Eigen::Quaterniond q_SE(X_SE.linear());
  points->xyz.resize(3 * scan.count);
  for (std::size_t i = 0; i < scan.count; ++i) {
    const auto beam = static_cast<double>(i);
    const double range = static_cast<double>(scan.ranges[i]);
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    switch (judge(scan, range, min_range, max_range)) {
      case Beam::kUnknown:
        p.setConstant(kNaN);
        break;
      case Beam::kNothing:
        p.setConstant(kInfinity);
        break;
      case Beam::kOutOfRange:
        p.x() = 2.0 * kLargestRange;
        break;
      case Beam::kHit: {
        const double angle = scan.angle_min + beam * scan.angle_increment;
        p = range * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
        if (!moves) break;
        const double t = beam / static_cast<double>(scan.count - 1);
        p = Eigen::Quaterniond::Identity().slerp(t, q_SE) * p + t * X_SE.translation();
      }
    }
    std::copy_n(p.data(), 3, points->xyz.begin() + static_cast<std::ptrdiff_t>(3 * i));
  }
}

}  // namespace ist
