#include "ros/input/map_measurement.h"

#include <ros/serialization.h>
#include <topic_tools/shape_shifter.h>

#include <chrono>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/octree.h"

namespace ist {
namespace {

namespace ser = ros::serialization;

constexpr const char* kMd5 = "9a45536b45c5e409cd49f04bb2d9999f";
constexpr const char* kType = "octomap_msgs/Octomap";
constexpr const char* kDefinition =
    "std_msgs/Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data\n"
    "\n================================================================================\n"
    "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";

topic_tools::ShapeShifter shape() {
  topic_tools::ShapeShifter message;
  message.morph(kMd5, kType, kDefinition, "");
  return message;
}

namespace ser = ros::serialization;

// A map stays in its own frame, so it waits for no transform; queries look its pose up.
class MapMeasurement : public Measurement {
 public:
  MapMeasurement(const std_msgs::Header& header, const Octree& octree,
                 std::chrono::steady_clock::time_point begin)
      : Measurement(header, octree.occupied.size() * sizeof(octree.occupied[0])) {
    auto index = std::make_shared<BoxIndex>();
    index->build(octree.occupied);
    index_ = index;
    received_ = static_cast<std::uint32_t>(octree.occupied.size() + octree.free);
    took_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

  std::vector<ros::Time> instants() const override { return {}; }

  void ingest(const Placement& /*placement*/, Ingest* /*ingest*/,
              CloudSnapshot* snapshot) const override {
    snapshot->boxes = index_;
    snapshot->counts = IngestCounts();
    snapshot->counts.received = received_;
    snapshot->counts.used = static_cast<std::uint32_t>(index_->size());
    snapshot->stamp = header().stamp.toSec();
    snapshot->ingest_time = took_;
  }

 private:
  std::shared_ptr<const BoxIndex> index_;
  std::uint32_t received_;
  double took_;
};

Received make_received(const std_msgs::Header& header, const Octree& octree,
                       std::chrono::steady_clock::time_point begin) {
  return {header, "", std::make_shared<MapMeasurement>(header, octree, begin)};
}

// Reads Header header, bool binary, string id, float64 resolution, int8[] data. Throws where the
// bytes end too early.
void parse(ser::IStream* stream, std_msgs::Header* header, OctreeData* data) {
  std::uint8_t is_binary = 0;
  std::uint32_t size = 0;
  ser::deserialize(*stream, *header);
  ser::deserialize(*stream, is_binary);
  ser::deserialize(*stream, data->id);
  ser::deserialize(*stream, data->resolution);
  ser::deserialize(*stream, size);
  data->is_binary = is_binary != 0;
  data->data = stream->advance(size);
  data->size = size;
}

}  // namespace

Received read_map(const topic_tools::ShapeShifter& message, const OctreeLimits& limits) {
  const auto begin = std::chrono::steady_clock::now();
  Received received;
  if (message.getDataType() != message_type(SourceType::kMap)) {
    // The header of an unknown type cannot be read.
    received.header.stamp = ros::Time::now();
    received.header.frame_id = "?";
    received.fault =
        "a " + message.getDataType() + " comes in, it must be a " + message_type(SourceType::kMap);
    return received;
  }
  OctreeData data;
  Octree octree;
  try {
    std::vector<std::uint8_t> bytes(message.size());
    ser::OStream out(bytes.data(), message.size());
    message.write(out);
    ser::IStream in(bytes.data(), message.size());
    parse(&in, &received.header, &data);
    received.fault = read_octree(data, &octree, limits);
    if (received.fault.empty()) return make_received(received.header, octree, begin);
  } catch (const std::exception& error) {  // the stream ends too early, or there is no memory
    received.fault = error.what();
  }
  received.fault = "malformed map: " + received.fault;
  return received;
}

Received read_map_file(const std::string& path, const std::string& frame_id,
                       const OctreeLimits& limits) {
  const auto begin = std::chrono::steady_clock::now();
  Received received;
  received.header.frame_id = frame_id;
  Octree octree;
  try {
    received.fault = read_octree_file(path, &octree, limits);
    if (received.fault.empty()) return make_received(received.header, octree, begin);
  } catch (const std::exception& error) {
    received.fault = "map file '" + path + "' cannot be read: " + error.what() + ".";
  }
  return received;
}

ros::Publisher advertise_map(ros::NodeHandle* nh, const std::string& topic) {
  return shape().advertise(*nh, topic, 1, true);
}

void publish_map(const ros::Publisher& publisher, const std_msgs::Header& header, double resolution,
                 const std::vector<std::uint8_t>& data) {
  const std::uint8_t is_binary = 1;
  const std::string id = "OcTree";
  std::vector<std::uint8_t> bytes(ser::serializationLength(header) + sizeof is_binary +
                                  ser::serializationLength(id) + sizeof resolution +
                                  ser::serializationLength(data));
  ser::OStream out(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ser::serialize(out, header);
  ser::serialize(out, is_binary);
  ser::serialize(out, id);
  ser::serialize(out, resolution);
  ser::serialize(out, data);
  ser::IStream in(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  topic_tools::ShapeShifter message = shape();
  message.read(in);
  publisher.publish(message);
}

}  // namespace ist
