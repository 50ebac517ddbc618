#include "ros/input/cloud_measurement.h"

#include <chrono>

#include "ros/input/cloud_conversion.h"

namespace ist {
namespace {

class CloudMeasurement : public Measurement {
 public:
  CloudMeasurement(const std_msgs::Header& header, const RawCloud& points, std::size_t bytes,
                   std::shared_ptr<NoiseFilter> noise)
      : Measurement(header, bytes), points_(points), noise_(std::move(noise)) {}

  const RawCloud* raw_cloud() const override { return &points_; }

  void ingest(const Placement& placement, Ingest* ingest, CloudSnapshot* snapshot) const override {
    const auto begin = std::chrono::steady_clock::now();
    std::uint32_t dropped = 0;
    const RawCloud cloud =
        noise_ ? noise_->run(points_, ingest->config().max_range, &dropped) : points_;
    const std::chrono::duration<double> filtering = std::chrono::steady_clock::now() - begin;
    ingest->run(cloud, placement.X_FS, placement.robot, header().stamp.toSec(), snapshot);
    snapshot->counts.noise = dropped;
    snapshot->counts.not_a_number -= dropped;
    snapshot->ingest_time += filtering.count();
  }

 private:
  RawCloud points_;  ///< views the message and keeps it alive
  std::shared_ptr<NoiseFilter> noise_;
};

}  // namespace

std::shared_ptr<const Measurement> make_cloud_measurement(
    const std_msgs::Header& header, const RawCloud& points, std::size_t bytes,
    const std::shared_ptr<NoiseFilter>& noise) {
  return std::make_shared<CloudMeasurement>(header, points, bytes, noise);
}

Received read_cloud(const sensor_msgs::PointCloud2ConstPtr& message, std::size_t max_points,
                    const std::shared_ptr<NoiseFilter>& noise) {
  RawCloud raw;
  const std::string fault = view_cloud(*message, max_points, &raw);
  if (!fault.empty()) return {message->header, "malformed cloud: " + fault, nullptr};
  raw.owner = std::shared_ptr<const void>(message.get(), [message](const void*) {});
  return {message->header, "",
          make_cloud_measurement(message->header, raw, message->data.size(), noise)};
}

}  // namespace ist
