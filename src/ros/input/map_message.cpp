#include "ros/input/map_message.h"

#include <ros/serialization.h>
#include <topic_tools/shape_shifter.h>

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

}  // namespace

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
