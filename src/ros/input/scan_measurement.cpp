#include <algorithm>
#include <cmath>
#include <cstdint>

#include "ist_proximity/cloud/laser_scan.h"
#include "ros/input/measurement.h"

namespace ist {
namespace {

// The poses of sensor and robot are looked up this often during a scan: a link that moves at 1 m/s
// is never farther from one of its poses than half the self-filter's usual padding, and a sensor
// at 10 m/s² less than a millimetre from where its motion between two of them is taken for even.
constexpr double kBetweenPoses = 0.025;  // [s]

// Stamps are later than 0, where simulated time begins, and end before 2^32 s: instants outside are
// moved to the nearest stamp there is.
ros::Time shifted(const ros::Time& stamp, double seconds) {
  const auto shift = static_cast<std::int64_t>(std::llround(1e9 * seconds));
  const auto latest = static_cast<std::int64_t>(ros::TIME_MAX.toNSec());
  const std::int64_t time = static_cast<std::int64_t>(stamp.toNSec()) + shift;
  ros::Time result;
  result.fromNSec(static_cast<std::uint64_t>(std::clamp<std::int64_t>(time, 1, latest)));
  return result;
}

// The beam that is measured at an instant of a scan; the last beam at the last one.
std::size_t beam_at(std::size_t instant, std::size_t beams, std::size_t instants) {
  return instants > 1 ? (beams - 1) * instant / (instants - 1) : 0;
}

std::vector<SensorAtBeam> sensor_by_beam(const Placement& placement, std::size_t beams) {
  const Eigen::Isometry3d X_SF = placement.X_FS.inverse();
  const std::size_t instants = placement.X_FS_at.size();
  std::vector<SensorAtBeam> sensor;
  for (std::size_t i = 0; i < instants; ++i) {
    sensor.push_back({beam_at(i, beams, instants), X_SF * placement.X_FS_at[i]});
  }
  return sensor;
}

// The robot's solids, each for the beams that were measured between the instants beside its own: a
// beam is compared with two poses of a link, however many there are. A scan of ten seconds while
// the robot turns has 400.
std::vector<PosedSolid> robot_by_beam(const Placement& placement, std::size_t beams,
                                      std::size_t instants) {
  std::vector<PosedSolid> robot = placement.robot;
  const std::size_t intervals = instants - 1, end = beams - 1;
  if (intervals == 0) return robot;
  const auto at = [&](std::size_t instant) { return beam_at(instant, beams, instants); };
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const auto [first, last] = placement.robot_instants[i];
    robot[i].first_point = static_cast<std::uint32_t>(first > 0 ? at(first - 1) : 0);
    robot[i].last_point = static_cast<std::uint32_t>(last < intervals ? at(last + 1) + 1 : end);
  }
  return robot;
}

}  // namespace

Measurement read_scan(const sensor_msgs::LaserScanConstPtr& message, const IngestConfig& ranges,
                      const ScanLimits& limits) {
  LaserScan scan;
  scan.angle_min = static_cast<double>(message->angle_min);
  scan.angle_increment = static_cast<double>(message->angle_increment);
  scan.time_increment = static_cast<double>(message->time_increment);
  scan.range_min = static_cast<double>(message->range_min);
  scan.range_max = static_cast<double>(message->range_max);
  scan.ranges = message->ranges.data();
  scan.count = message->ranges.size();
  const std::string fault = check_scan(scan, limits);
  if (!fault.empty()) return faulty(message->header, "malformed scan: " + fault);
  Measurement measurement;
  measurement.header = message->header;
  measurement.bytes = message->ranges.size() * sizeof(float);
  const double poses = std::ceil(std::abs(scan.duration()) / kBetweenPoses) + 1.0;
  const std::size_t instants = std::min(static_cast<std::size_t>(poses), scan.count);
  for (std::size_t i = 0; i < instants; ++i) {
    const auto beam = static_cast<double>(beam_at(i, scan.count, instants));
    measurement.instants.push_back(shifted(message->header.stamp, beam * scan.time_increment));
  }
  measurement.take_in = [message, scan, ranges, instants](const Placement& placement,
                                                          Ingest* ingest, CloudSnapshot* snapshot) {
    ScanPoints points;
    to_points(scan, ranges.min_range, ranges.max_range, sensor_by_beam(placement, scan.count),
              &points, ranges.sensor_range);
    ingest->run(points.raw(), placement.X_FS, robot_by_beam(placement, scan.count, instants),
                message->header.stamp.toSec(), snapshot, placement.paddings);
  };
  return measurement;
}

}  // namespace ist
