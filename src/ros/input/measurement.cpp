#include "ros/input/measurement.h"

#include <algorithm>
#include <boost/function.hpp>
#include <cmath>
#include <cstring>
#include <limits>

#include "ros/common/eigen_conversion.h"
#include "ros/input/cloud_measurement.h"
#include "ros/input/image_measurement.h"
#include "ros/input/map_measurement.h"
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

// FNV-1a by words of eight bytes; never 0.
std::uint64_t hash_of(const void* data, std::size_t size) {
  constexpr std::uint64_t kOffset = 14695981039346656037ULL, kPrime = 1099511628211ULL;
  std::uint64_t hash = kOffset;
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  for (std::size_t i = 0; i < size; i += sizeof(std::uint64_t)) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + i, std::min(sizeof word, size - i));
    hash = (hash ^ word) * kPrime;
    hash ^= hash >> 32U;  // so that the highest bits of a word count for the lowest, too
  }
  return std::max<std::uint64_t>(hash, 1);
}

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
  return hash_of(all.data(), all.size() * sizeof all[0]);
}
std::uint64_t content_of(const topic_tools::ShapeShifter& /*map*/, const SourceConfig& /*config*/) {
  return 0;
}

template <typename Message>
using Factory = boost::function<boost::shared_ptr<Message>()>;

// @param make  makes the messages to receive into
template <typename Message, typename Read>
ros::Subscriber subscribe_as(const SourceConfig& config, ros::NodeHandle* nh,
                             const ReadingBegins& begin, const Receiver& receive, const Read& read,
                             const Factory<Message>& make = ros::DefaultMessageCreator<Message>()) {
  const boost::function<void(const boost::shared_ptr<const Message>&)> callback =
      [begin, receive, read, config](const boost::shared_ptr<const Message>& message) {
        begin();
        Received received = read(message);
        received.content = content_of(*message, config);
        receive(received);
      };
  ros::SubscribeOptions options;
  options.init<Message>(config.topic, kQueueSize, callback, make);
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

Subscription subscribe(const SourceConfig& config, ros::NodeHandle* nh, const ReadingBegins& begin,
                       const Receiver& receive) {
  Subscription subscription;
  if (config.type == SourceType::kScan) {
    IngestConfig ranges = config.ingest;
    ranges.max_range = std::min(ranges.max_range, kFarthestPoint);
    const ScanLimits limits = config.scan;
    subscription.messages = subscribe_as<sensor_msgs::LaserScan>(
        config, nh, begin, receive,
        [ranges, limits](const sensor_msgs::LaserScanConstPtr& message) {
          return read_scan(message, ranges, limits);
        });
    return subscription;
  }
  if (config.type == SourceType::kMap) {
    const OctreeLimits limits = config.map;
    subscription.messages = subscribe_as<topic_tools::ShapeShifter>(
        config, nh, begin, receive, [limits](const topic_tools::ShapeShifter::ConstPtr& message) {
          return read_map(*message, limits);
        });
    return subscription;
  }
  const std::shared_ptr<NoiseFilter> noise =
      config.noise.radius > 0.0 ? std::make_shared<NoiseFilter>(config.noise) : nullptr;
  const std::size_t max_points = config.ingest.max_points;
  if (config.type == SourceType::kDepthImage) {
    const std::string topic = config.camera_info.empty()
                                  ? sibling_camera_info(nh->resolveName(config.topic))
                                  : nh->resolveName(config.camera_info);
    const auto camera = std::make_shared<DepthCamera>(config.name, topic);
    const boost::function<void(const sensor_msgs::CameraInfoConstPtr&)> take =
        [camera](const sensor_msgs::CameraInfoConstPtr& message) { camera->take(*message); };
    subscription.camera_info = nh->subscribe<sensor_msgs::CameraInfo>(topic, 1, take);
    subscription.messages = subscribe_as<sensor_msgs::Image>(
        config, nh, begin, receive,
        [camera, max_points, noise,
         unit = config.depth_unit](const sensor_msgs::ImageConstPtr& message) {
          return read_image(message, *camera, unit, max_points, noise);
        },
        from_pool<sensor_msgs::Image>());
    return subscription;
  }
  subscription.messages = subscribe_as<sensor_msgs::PointCloud2>(
      config, nh, begin, receive,
      [max_points, noise](const sensor_msgs::PointCloud2ConstPtr& message) {
        return read_cloud(message, max_points, noise);
      },
      from_pool<sensor_msgs::PointCloud2>());
  return subscription;
}

}  // namespace ist
