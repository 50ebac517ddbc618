#include <ros/serialization.h>
#include <topic_tools/shape_shifter.h>

#include <chrono>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/octree.h"
#include "ros/input/measurement.h"

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

// A map stays in its own frame, so it waits for no transform; queries look its pose up.
Measurement measure_map(const std_msgs::Header& header, const Octree& octree,
                        std::chrono::steady_clock::time_point begin) {
  auto index = std::make_shared<BoxIndex>();
  index->build(octree.occupied);
  IngestCounts counts;
  counts.received = static_cast<std::uint32_t>(octree.occupied.size() + octree.free);
  counts.used = static_cast<std::uint32_t>(index->size());
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  Measurement measurement;
  measurement.header = header;
  measurement.take_in = [index, counts, stamp = header.stamp.toSec(), took](
                            const Placement& /*placement*/, Ingest* /*ingest*/,
                            CloudSnapshot* snapshot) {
    snapshot->boxes = index;
    snapshot->counts = counts;
    snapshot->stamp = stamp;
    snapshot->ingest_time = took.count();
  };
  return measurement;
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

Measurement read_map(const topic_tools::ShapeShifter& message, const OctreeLimits& limits) {
  const auto begin = std::chrono::steady_clock::now();
  std_msgs::Header header;
  if (message.getDataType() != message_type(SourceType::kMap)) {
    // The header of an unknown type cannot be read.
    header.stamp = ros::Time::now();
    header.frame_id = "?";
    return faulty(header, "a " + message.getDataType() + " comes in, it must be a " +
                              message_type(SourceType::kMap));
  }
  OctreeData data;
  Octree octree;
  std::string fault;
  try {
    std::vector<std::uint8_t> bytes(message.size());
    ser::OStream out(bytes.data(), message.size());
    message.write(out);
    ser::IStream in(bytes.data(), message.size());
    parse(&in, &header, &data);
    fault = read_octree(data, &octree, limits);
    if (fault.empty()) return measure_map(header, octree, begin);
  } catch (const std::exception& error) {  // the stream ends too early, or there is no memory
    fault = error.what();
  }
  return faulty(header, "malformed map: " + fault);
}

Measurement read_map_file(const std::string& path, const std::string& frame_id,
                          const OctreeLimits& limits) {
  const auto begin = std::chrono::steady_clock::now();
  std_msgs::Header header;
  header.frame_id = frame_id;
  Octree octree;
  try {
    const std::string fault = read_octree_file(path, &octree, limits);
    return fault.empty() ? measure_map(header, octree, begin) : faulty(header, fault);
  } catch (const std::exception& error) {
    return faulty(header, "map file '" + path + "' cannot be read: " + error.what() + ".");
  }
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
