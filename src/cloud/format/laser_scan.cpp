#include "ist_proximity/cloud/laser_scan.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <sstream>

#include "internal/cloud/largest_range.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

constexpr double kTwoTurns = 12.6;  // [rad] and a little more

std::string fault(const char* member, double value, const char* expected) {
  std::ostringstream text;
  text << member << " is " << value << ", " << expected << ".";
  return text.str();
}

// [m] Before REP 117, drivers wrote range_max + 1 where nothing was there.
constexpr double kAboveMaximum = 1.0, kRounded = 1.0 + 1e-6;  // the sum as float
// [m] Along a ray, places that Ingest takes for farther than max_range, and for not believed.
constexpr double kFar = 2.0 * kLargestRange, kImplausible = 4.0 * kLargestRange;

enum class Beam { kHit, kNothing, kUnknown, kTooNear, kTooFar, kNotBelieved };

struct RangeLimits {
  double min, max, sensor;  // [m]
};

Beam judge(const LaserScan& scan, double range, const RangeLimits& limits) {
  if (!(range >= scan.range_min)) return Beam::kUnknown;  // NaN and -inf too
  if (range == kInfinity) return Beam::kNothing;
  const double above_maximum = (scan.range_max + kAboveMaximum) * kRounded;
  if (range > limits.sensor || range > above_maximum) return Beam::kNotBelieved;
  if (range > scan.range_max) return Beam::kNothing;
  if (range < limits.min) return Beam::kTooNear;
  return range > limits.max ? Beam::kTooFar : Beam::kHit;
}

// The sensor's poses, asked beam by beam.
class SensorMotion {
 public:
  explicit SensorMotion(Span<const SensorAtBeam> poses) : poses_(poses) {
    if (poses_.size() > 1) begin_interval();
  }

  // @param beam  not before that of the last call
  // @returns a point that is given in the sensor's frame at this beam, in its frame at the first
  Eigen::Vector3d place(std::size_t beam, const Eigen::Vector3d& p) {
    if (poses_.size() < 2) return p;
    while (next_ + 1 < poses_.size() && poses_[next_].beam < beam) {
      ++next_;
      begin_interval();
    }
    const SensorAtBeam &a = poses_[next_ - 1], &b = poses_[next_];
    const double t = static_cast<double>(beam - a.beam) / static_cast<double>(b.beam - a.beam);
    return q_SA_.slerp(t, q_SB_) * p + (1.0 - t) * a.X_SB.translation() + t * b.X_SB.translation();
  }

 private:
  void begin_interval() {
    q_SA_ = poses_[next_ - 1].X_SB.linear();
    q_SB_ = poses_[next_].X_SB.linear();
  }

  Span<const SensorAtBeam> poses_;
  std::size_t next_ = 1;            // the pose that the beam is before, or in
  Eigen::Quaterniond q_SA_, q_SB_;  // of the poses before and after it
};

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
  cloud.from_rays = true;
  cloud.sensor_moved = sensor_moved;
  cloud.believed_range = 0.5 * (kFar + kImplausible);
  return cloud;
}

void to_points(const LaserScan& scan, double min_range, double max_range,
               Span<const SensorAtBeam> sensor, ScanPoints* points, double sensor_range) {
  const RangeLimits limits = {min_range, max_range, std::max(sensor_range, max_range)};
  points->beam_angle = std::abs(scan.angle_increment);
  if (scan.time_increment == 0.0) sensor = {};
  assert(sensor.empty() ||
         (sensor[0].beam == 0 && sensor[sensor.size() - 1].beam + 1 == scan.count));
  points->sensor_moved = 0.0;
  for (const SensorAtBeam& at : sensor) {
    points->sensor_moved = std::max(points->sensor_moved, at.X_SB.translation().norm());
  }
  SensorMotion motion(sensor);
  points->xyz.resize(3 * scan.count);
  for (std::size_t i = 0; i < scan.count; ++i) {
    const double range = static_cast<double>(scan.ranges[i]);
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    switch (judge(scan, range, limits)) {
      case Beam::kUnknown:
        p.setConstant(kNaN);
        break;
      case Beam::kNothing:
        p.setConstant(kInfinity);
        break;
      case Beam::kTooNear:
        break;  // at the origin
      case Beam::kTooFar:
        p.x() = kFar;
        break;
      case Beam::kNotBelieved:
        p.x() = kImplausible;
        break;
      case Beam::kHit: {
        const double angle = scan.angle_min + static_cast<double>(i) * scan.angle_increment;
        p = motion.place(i, range * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0));
      }
    }
    std::copy_n(p.data(), 3, points->xyz.begin() + static_cast<std::ptrdiff_t>(3 * i));
  }
}

}  // namespace ist
