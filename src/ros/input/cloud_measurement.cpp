#include "ros/input/cloud_measurement.h"

#include <boost/make_shared.hpp>
#include <chrono>
#include <cstring>

#include "internal/cloud/point_bvh.h"

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
    ingest->run(cloud, placement.X_FS, placement.robot, header().stamp.toSec(), snapshot,
                placement.paddings);
    snapshot->counts.noise = dropped;
    snapshot->counts.not_a_number -= dropped;
    snapshot->ingest_time += filtering.count();
  }

 private:
  RawCloud points_;  ///< views the message and keeps it alive
  std::shared_ptr<NoiseFilter> noise_;
};

}  // namespace

std::string view_cloud(const sensor_msgs::PointCloud2& message, std::size_t max_points,
                       RawCloud* raw) {
  CloudLayout layout;
  for (const sensor_msgs::PointField& field : message.fields) {
    layout.fields.push_back({field.name, field.offset, field.datatype, field.count});
  }
  layout.width = message.width;
  layout.height = message.height;
  layout.point_step = message.point_step;
  layout.row_step = message.row_step;
  layout.is_bigendian = message.is_bigendian;
  layout.data = message.data.data();
  layout.data_size = message.data.size();
  return check_layout(layout, raw, max_points);
}

sensor_msgs::PointCloud2Ptr to_message(const CloudSnapshot& snapshot, const ros::Time& stamp,
                                       const std::string& fixed_frame) {
  auto message = boost::make_shared<sensor_msgs::PointCloud2>();
  message->header.stamp = stamp;
  message->header.frame_id = fixed_frame;
  const char* names[] = {"x", "y", "z"};
  for (std::uint32_t i = 0; i < 3; ++i) {
    sensor_msgs::PointField field;
    field.name = names[i];
    field.offset = 4 * i;
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    message->fields.push_back(field);
  }
  message->height = 1;
  message->width = static_cast<std::uint32_t>(snapshot.index.size());
  message->point_step = 12;
  message->row_step = message->point_step * message->width;
  message->is_dense = true;
  message->data.resize(message->row_step);

  std::uint8_t* out = message->data.data();
  const Eigen::Isometry3d& X_FO = snapshot.index.X_FO();
  PointTile scratch;
  const PointBvh& points = snapshot.index.bvh();
  for (std::size_t number = 0; number < points.tile_count(); ++number) {
    const PointTile& tile = points.tile(number, &scratch);
    for (int i = 0; i < tile.count; ++i) {
      const Eigen::Vector3f p_F = (X_FO * tile.point(i)).cast<float>();
      std::memcpy(out, p_F.data(), 3 * sizeof(float));
      out += 3 * sizeof(float);
    }
  }
  return message;
}

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
