#include "ros/input/measurement.h"

#include <sensor_msgs/PointCloud2.h>

#include <algorithm>
#include <boost/function.hpp>
#include <chrono>
#include <limits>

#include "ros/common/eigen_conversion.h"
#include "ros/input/cloud_conversion.h"
#include "ros/input/map_measurement.h"
#include "ros/input/noise_filter.h"
#include "ros/input/scan_measurement.h"

namespace ist {
namespace {

// The queue is short: while one cloud is ingested, only the newest other one is worth keeping.
constexpr std::uint32_t kQueueSize = 2;

// Points farther from their sensor are out of range, with max_range inf too. Sensors and links are
// within kMaxPosition of the fixed frame's origin along each axis, so that no link is so far. [m]
constexpr double kFarthestPoint = 4.0 * kMaxPosition;

class CloudMeasurement : public Measurement {
 public:
  /// @param noise  null: no noise filter
  CloudMeasurement(const sensor_msgs::PointCloud2ConstPtr& message, const RawCloud& raw,
                   std::shared_ptr<NoiseFilter> noise)
      : Measurement(message->header, message->data.size()), raw_(raw), noise_(std::move(noise)) {
    raw_.owner = std::shared_ptr<const void>(message.get(), [message](const void*) {});
  }

  void ingest(const Placement& placement, Ingest* ingest, CloudSnapshot* snapshot) const override {
    const auto begin = std::chrono::steady_clock::now();
    std::uint32_t dropped = 0;
    const RawCloud cloud = noise_ ? noise_->run(raw_, ingest->config().max_range, &dropped) : raw_;
    const std::chrono::duration<double> filtering = std::chrono::steady_clock::now() - begin;
    ingest->run(cloud, placement.X_FS, placement.robot, header().stamp.toSec(), snapshot);
    snapshot->counts.noise = dropped;
    snapshot->counts.not_a_number -= dropped;
    snapshot->ingest_time += filtering.count();
  }

 private:
  RawCloud raw_;  ///< views the message and keeps it alive
  std::shared_ptr<NoiseFilter> noise_;
};

Received read_cloud(const sensor_msgs::PointCloud2ConstPtr& message, std::size_t max_points,
                    const std::shared_ptr<NoiseFilter>& noise) {
  RawCloud raw;
  const std::string fault = view_cloud(*message, max_points, &raw);
  if (!fault.empty()) return {message->header, "malformed cloud: " + fault, nullptr};
  return {message->header, "", std::make_shared<CloudMeasurement>(message, raw, noise)};
}

template <typename Message, typename Read>
ros::Subscriber subscribe_as(const SourceConfig& config, ros::NodeHandle* nh,
                             const ReadingBegins& begin, const Receiver& receive,
                             const Read& read) {
  const boost::function<void(const boost::shared_ptr<const Message>&)> callback =
      [begin, receive, read](const boost::shared_ptr<const Message>& message) {
        begin();
        receive(read(message));
      };
  return nh->subscribe<Message>(config.topic, kQueueSize, callback, {},
                                ros::TransportHints().tcpNoDelay());
}

}  // namespace

IngestConfig ingest_config(const SourceConfig& config) {
  IngestConfig ingest = config.ingest;
  ingest.max_range = std::min(ingest.max_range, kFarthestPoint);
  if (config.type == SourceType::kScan) {  // read_scan() applies the limits to each beam
    ingest.min_range = 0.0;
    ingest.max_range = std::numeric_limits<double>::infinity();
    ingest.max_points = config.scan.max_beams;
  }
  return ingest;
}

ros::Subscriber subscribe(const SourceConfig& config, ros::NodeHandle* nh,
                          const ReadingBegins& begin, const Receiver& receive) {
  if (config.type == SourceType::kScan) {
    IngestConfig ranges = config.ingest;
    ranges.max_range = std::min(ranges.max_range, kFarthestPoint);
    const ScanLimits limits = config.scan;
    return subscribe_as<sensor_msgs::LaserScan>(
        config, nh, begin, receive,
        [ranges, limits](const sensor_msgs::LaserScanConstPtr& message) {
          return read_scan(message, ranges.min_range, ranges.max_range, limits);
        });
  }
  if (config.type == SourceType::kMap) {
    const OctreeLimits limits = config.map;
    return subscribe_as<topic_tools::ShapeShifter>(
        config, nh, begin, receive, [limits](const topic_tools::ShapeShifter::ConstPtr& message) {
          return read_map(*message, limits);
        });
  }
  const std::shared_ptr<NoiseFilter> noise =
      config.noise.radius > 0.0 ? std::make_shared<NoiseFilter>(config.noise) : nullptr;
  const std::size_t max_points = config.ingest.max_points;
  return subscribe_as<sensor_msgs::PointCloud2>(
      config, nh, begin, receive,
      [max_points, noise](const sensor_msgs::PointCloud2ConstPtr& message) {
        return read_cloud(message, max_points, noise);
      });
}

}  // namespace ist
