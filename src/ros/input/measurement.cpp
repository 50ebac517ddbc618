#include "ros/input/measurement.h"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <boost/function.hpp>
#include <boost/make_shared.hpp>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string_view>

#include "internal/cloud/point_bvh.h"
#include "ros/common/eigen_conversion.h"
#include "ros/input/receive_pool.h"

namespace ist {
namespace {

// The queue is short: while one cloud is ingested, only the newest other one is worth keeping.
constexpr std::uint32_t kQueueSize = 2;

// Points farther from their sensor are out of range, with max_range inf too. Sensors and links are
// within kMaxPosition of the fixed frame's origin along each axis, so that no link is so far. [m]
constexpr double kFarthestPoint = 4.0 * kMaxPosition;

// [m] Nothing is nearer to a sensor's origin: drivers write (0, 0, 0) for no return.
constexpr double kAtOrigin = 1e-6;

// [rad] A camera has at least 160 pixels across 90 degrees. With fewer, its clouds may be cropped a
// little nearer than max_distance, and links out there say so.
constexpr double kLargestPixelAngle = 0.0125;

const std::vector<std::uint8_t>& numbers(const sensor_msgs::PointCloud2& message) {
  return message.data;
}
const std::vector<std::uint8_t>& numbers(const sensor_msgs::Image& message) { return message.data; }
const std::vector<float>& numbers(const sensor_msgs::LaserScan& message) { return message.ranges; }

// What the numbers of a message are, where ~frozen_after asks for it.
template <typename Message>
std::uint64_t content_of(const Message& message, const SourceConfig& config) {
  if (std::isinf(config.frozen_after)) return 0;
  const auto& all = numbers(message);
  const std::string_view bytes(reinterpret_cast<const char*>(all.data()),
                               all.size() * sizeof all[0]);
  return std::max<std::uint64_t>(std::hash<std::string_view>()(bytes), 1);
}
std::uint64_t content_of(const topic_tools::ShapeShifter& /*map*/, const SourceConfig& /*config*/) {
  return 0;
}

using Receiver = std::function<void(const std::function<Measurement()>&)>;
template <typename Message>
using Factory = boost::function<boost::shared_ptr<Message>()>;

// @param make  makes the messages to receive into
template <typename Message, typename Read>
ros::Subscriber subscribe_as(const SourceConfig& config, ros::NodeHandle* nh,
                             const Receiver& receive, const Read& read,
                             const Factory<Message>& make = ros::DefaultMessageCreator<Message>()) {
  using Event = ros::MessageEvent<const Message>;
  const boost::function<void(const Event&)> callback = [receive, read, config](const Event& event) {
    receive([&] {
      Measurement measurement = read(event.getConstMessage());
      measurement.publisher = event.getPublisherName();
      measurement.content = content_of(*event.getConstMessage(), config);
      return measurement;
    });
  };
  ros::SubscribeOptions options;
  options.initByFullCallbackType<const Event&>(config.topic, kQueueSize, callback, make);
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  return nh->subscribe(options);
}

// The messages of a camera, whose memory is used again.
template <typename Message>
Factory<Message> from_pool() {
  return [pool = std::make_shared<ReceivePool<Message>>()] { return pool->take(); };
}

}  // namespace

double map_extent(const SourceConfig& config) {
  return point_extent(config.ingest.extent, 0.0, 0.0).constant;
}

double largest_extent(const SourceConfig& config) {
  if (config.ingest.extent.is_zero() || config.type == SourceType::kWorld) return 0.0;
  if (config.type == SourceType::kMap) return map_extent(config);
  const double max_range = std::min(config.ingest.max_range, kFarthestPoint);
  const PointExtent extent = point_extent(config.ingest.extent, kLargestPixelAngle, max_range);
  return std::min(extent.radius(max_range), kMaxExtent);
}

IngestConfig ingest_config(const SourceConfig& config) {
  IngestConfig ingest = config.ingest;
  ingest.min_range = std::max(ingest.min_range, kAtOrigin);
  ingest.max_range = std::min(ingest.max_range, kFarthestPoint);
  if (config.type == SourceType::kScan) {  // read_scan() applies the limits to each beam
    ingest.extent.max_range = ingest.max_range;
    ingest.min_range = 0.0;
    ingest.max_range = std::numeric_limits<double>::infinity();
    ingest.max_points = config.scan.max_beams;
  }
  return ingest;
}

Measurement faulty(const std_msgs::Header& header, const std::string& fault) {
  Measurement measurement;
  measurement.header = header;
  measurement.fault = fault;
  return measurement;
}

Measurement measure_points(const std_msgs::Header& header, const RawCloud& points,
                           std::size_t bytes, const std::shared_ptr<NoiseFilter>& noise) {
  Measurement measurement;
  measurement.header = header;
  measurement.bytes = bytes;
  measurement.instants = {header.stamp};
  measurement.points = points;
  measurement.take_in = [points, noise, stamp = header.stamp.toSec()](
                            const Placement& placement, Ingest* ingest, CloudSnapshot* snapshot) {
    const auto begin = std::chrono::steady_clock::now();
    std::uint32_t dropped = 0;
    const RawCloud cloud =
        noise ? noise->run(points, ingest->config().max_range, &dropped) : points;
    const std::chrono::duration<double> filtering = std::chrono::steady_clock::now() - begin;
    ingest->run(cloud, placement.X_FS, placement.robot, stamp, snapshot, placement.paddings);
    snapshot->counts.noise = dropped;
    snapshot->counts.not_a_number -= dropped;
    snapshot->ingest_time += filtering.count();
  };
  return measurement;
}

Measurement read_cloud(const sensor_msgs::PointCloud2ConstPtr& message,
                       const std::shared_ptr<NoiseFilter>& noise) {
  CloudLayout layout;
  for (const sensor_msgs::PointField& field : message->fields) {
    layout.fields.push_back({field.name, field.offset, field.datatype, field.count});
  }
  layout.width = message->width;
  layout.height = message->height;
  layout.point_step = message->point_step;
  layout.row_step = message->row_step;
  layout.is_bigendian = message->is_bigendian;
  layout.data = message->data.data();
  layout.data_size = message->data.size();
  RawCloud raw;
  const std::string fault = check_layout(layout, &raw);
  if (!fault.empty()) return faulty(message->header, "malformed cloud: " + fault);
  raw.owner = std::shared_ptr<const void>(message.get(), [message](const void*) {});
  return measure_points(message->header, raw, message->data.size(), noise);
}

sensor_msgs::PointCloud2Ptr to_message(const CloudSnapshot& snapshot, const ros::Time& stamp,
                                       const std::string& fixed_frame) {
  constexpr auto kFloat = sensor_msgs::PointField::FLOAT32;
  auto message = boost::make_shared<sensor_msgs::PointCloud2>();
  message->header.stamp = stamp;
  message->header.frame_id = fixed_frame;
  message->is_dense = true;
  sensor_msgs::PointCloud2Modifier modifier(*message);
  modifier.setPointCloud2Fields(3, "x", 1, kFloat, "y", 1, kFloat, "z", 1, kFloat);
  modifier.resize(snapshot.index.size());
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

std::vector<ros::Subscriber> subscribe(const SourceConfig& config, ros::NodeHandle* nh,
                                       const Receiver& receive) {
  if (config.type == SourceType::kScan) {
    IngestConfig ranges = config.ingest;
    ranges.max_range = std::min(ranges.max_range, kFarthestPoint);
    return {subscribe_as<sensor_msgs::LaserScan>(
        config, nh, receive, [ranges, limits = config.scan](const auto& message) {
          return read_scan(message, ranges, limits);
        })};
  }
  if (config.type == SourceType::kMap) {
    return {subscribe_as<topic_tools::ShapeShifter>(
        config, nh, receive,
        [limits = config.map](const auto& message) { return read_map(*message, limits); })};
  }
  const auto noise =
      config.noise.radius > 0.0 ? std::make_shared<NoiseFilter>(config.noise) : nullptr;
  if (config.type == SourceType::kCloud) {
    return {subscribe_as<sensor_msgs::PointCloud2>(
        config, nh, receive, [noise](const auto& message) { return read_cloud(message, noise); },
        from_pool<sensor_msgs::PointCloud2>())};
  }
  // By ROS' convention the CameraInfo is beside the images.
  const std::string images = nh->resolveName(config.topic);
  const std::string topic = config.camera_info.empty()
                                ? images.substr(0, images.rfind('/') + 1) + "camera_info"
                                : nh->resolveName(config.camera_info);
  const auto camera = std::make_shared<DepthCamera>(config, topic, noise);
  const boost::function<void(const sensor_msgs::CameraInfoConstPtr&)> take =
      [camera](const sensor_msgs::CameraInfoConstPtr& message) { camera->take(*message); };
  const ros::Subscriber camera_info = nh->subscribe<sensor_msgs::CameraInfo>(topic, 1, take);
  return {subscribe_as<sensor_msgs::Image>(
              config, nh, receive, [camera](const auto& message) { return camera->read(message); },
              from_pool<sensor_msgs::Image>()),
          camera_info};
}

}  // namespace ist
