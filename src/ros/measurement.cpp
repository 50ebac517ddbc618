#include "ist_proximity/ros/measurement.h"

#include <sensor_msgs/PointCloud2.h>

#include <boost/function.hpp>
#include <limits>

#include "ist_proximity/ros/cloud_conversion.h"
#include "ist_proximity/ros/map_measurement.h"
#include "ist_proximity/ros/scan_measurement.h"

namespace ist {
namespace {

// A short queue: while one cloud is ingested, only the newest of the others is worth keeping.
constexpr std::uint32_t kQueue = 2;

class CloudMeasurement : public Measurement {
 public:
  CloudMeasurement(const sensor_msgs::PointCloud2ConstPtr& message, const RawCloud& raw)
      : Measurement(message->header), message_(message), raw_(raw) {}

  void ingest(const Placement& placement, Ingest* ingest, CloudSnapshot* snapshot) const override {
    ingest->run(raw_, placement.X_FS, placement.robot, header().stamp.toSec(), snapshot);
  }

 private:
  sensor_msgs::PointCloud2ConstPtr message_;
  RawCloud raw_;  ///< views the message
};

Received read_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  RawCloud raw;
  const std::string fault = view_cloud(*message, &raw);
  if (!fault.empty()) return {message->header, "malformed cloud: " + fault, nullptr};
  return {message->header, "", std::make_shared<CloudMeasurement>(message, raw)};
}

template <typename Message, typename Read>
ros::Subscriber subscribe_as(const SourceConfig& config, ros::NodeHandle* nh,
                             const Receiver& receive, const Read& read) {
  const boost::function<void(const boost::shared_ptr<const Message>&)> callback =
      [receive, read](const boost::shared_ptr<const Message>& message) { receive(read(message)); };
  return nh->subscribe<Message>(config.topic, kQueue, callback, {},
                                ros::TransportHints().tcpNoDelay());
}

}  // namespace

IngestConfig ingest_config(const SourceConfig& config) {
  IngestConfig ingest = config.ingest;
  if (config.type == SourceType::kScan) {  // each beam knows its own range
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
  return subscribe_as<sensor_msgs::PointCloud2>(config, nh, receive, read_cloud);
}

}  // namespace ist
