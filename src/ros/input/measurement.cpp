#include "ros/input/measurement.h"

#include <sensor_msgs/PointCloud2.h>

#include <boost/function.hpp>
#include <chrono>
#include <limits>

#include "ros/input/cloud_conversion.h"
#include "ros/input/map_measurement.h"
#include "ros/input/noise_filter.h"
#include "ros/input/scan_measurement.h"

namespace ist {
namespace {

// The queue is short: while one cloud is ingested, only the newest other one is worth keeping.
constexpr std::uint32_t kQueueSize = 2;

class CloudMeasurement : public Measurement {
 public:
  /// @param noise  null: no noise filter
  CloudMeasurement(const sensor_msgs::PointCloud2ConstPtr& message, const RawCloud& raw,
                   std::shared_ptr<NoiseFilter> noise)
      : Measurement(message->header), raw_(raw), noise_(std::move(noise)) {
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

Received read_cloud(const sensor_msgs::PointCloud2ConstPtr& message,
                    const std::shared_ptr<NoiseFilter>& noise) {
  RawCloud raw;
  const std::string fault = view_cloud(*message, &raw);
  if (!fault.empty()) return {message->header, "malformed cloud: " + fault, nullptr};
  return {message->header, "", std::make_shared<CloudMeasurement>(message, raw, noise)};
}

template <typename Message, typename Read>
ros::Subscriber subscribe_as(const SourceConfig& config, ros::NodeHandle* nh,
                             const Receiver& receive, const Read& read) {
  const boost::function<void(const boost::shared_ptr<const Message>&)> callback =
      [receive, read](const boost::shared_ptr<const Message>& message) { receive(read(message)); };
  return nh->subscribe<Message>(config.topic, kQueueSize, callback, {},
                                ros::TransportHints().tcpNoDelay());
}

}  // namespace

IngestConfig ingest_config(const SourceConfig& config) {
  IngestConfig ingest = config.ingest;
  if (config.type == SourceType::kScan) {  // read_scan() applies the limits to each beam
    ingest.min_range = 0.0;
    ingest.max_range = std::numeric_limits<double>::infinity();
  }
  return ingest;
}

ros::Subscriber subscribe(const SourceConfig& config, ros::NodeHandle* nh,
                          const Receiver& receive) {
  if (config.type == SourceType::kScan) {
    const IngestConfig limits = config.ingest;
    return subscribe_as<sensor_msgs::LaserScan>(
        config, nh, receive, [limits](const sensor_msgs::LaserScanConstPtr& message) {
          return read_scan(message, limits.min_range, limits.max_range);
        });
  }
  if (config.type == SourceType::kMap) {
    return subscribe_as<topic_tools::ShapeShifter>(
        config, nh, receive,
        [](const topic_tools::ShapeShifter::ConstPtr& message) { return read_map(*message); });
  }
  const std::shared_ptr<NoiseFilter> noise =
      config.noise.radius > 0.0 ? std::make_shared<NoiseFilter>(config.noise) : nullptr;
  return subscribe_as<sensor_msgs::PointCloud2>(
      config, nh, receive, [noise](const sensor_msgs::PointCloud2ConstPtr& message) {
        return read_cloud(message, noise);
      });
}

}  // namespace ist
