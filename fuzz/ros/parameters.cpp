// Parameters as the parameter server holds them: what is read lies in its ranges, and what is wrong
// is said.
//
// Covers: src/ros/parameters/parameters.cpp src/ros/parameters/parameter_reader.cpp
// Covers: src/ros/parameters/source_parameters.cpp src/ros/parameters/parameter_table.cpp
// Covers: src/ros/common/text.cpp
// Longest input: 400

#include "ros/parameters/parameters.h"
#include "ros/parameters/parameter_table.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;
using XmlRpc::XmlRpcValue;

constexpr int kDeepest = 3;

// Names that the node reads, and some that it does not.
std::string name(ByteReader* in) {
  static const char* const kNames[] = {"query",        "margin",        "tolerance",
                                       "deadline",     "repulsion",     "influence_distance",
                                       "gain",         "smoothing",     "packing",
                                       "max_error",    "max_spheres",   "threads",
                                       "penetration",  "enabled",       "sources",
                                       "topic",        "type",          "timeout",
                                       "min_range",    "max_range",     "self_filter",
                                       "padding",      "voxel_size",    "noise_filter",
                                       "radius",       "links",         "rate",
                                       "max_distance", "pose_source",   "geometry",
                                       "fixed_frame",  "pose_timeout",  "robot_description",
                                       "required",     "cloud_timeout", "cache_directory",
                                       "file",         "frame_id",      "self_collision",
                                       "ignore",       "camera",        "tolerence",
                                       "map",          "scan"};
  const std::size_t known = sizeof kNames / sizeof kNames[0];
  const std::size_t k = in->below(known + 4);
  return k < known ? kNames[k] : in->text(12);
}

std::string word(ByteReader* in) {
  static const char* const kWords[] = {"tf",
                                       "joint_states",
                                       "collision",
                                       "visual",
                                       "/a",
                                       "",
                                       "sensor_msgs/PointCloud2",
                                       "sensor_msgs/Image",
                                       "sensor_msgs/LaserScan",
                                       "octomap_msgs/Octomap",
                                       "world"};
  const std::size_t known = sizeof kWords / sizeof kWords[0];
  const std::size_t k = in->below(known + 3);
  return k < known ? kWords[k] : in->text(40);
}

XmlRpcValue value_from(ByteReader* in, int depth) {
  switch (in->below(depth < kDeepest ? 9 : 5)) {
    case 0:
      return XmlRpcValue(in->number(2.0));
    case 1:
      return XmlRpcValue(static_cast<int>(in->byte()));
    case 2:
      return XmlRpcValue(in->flag());
    case 3:
      return XmlRpcValue(word(in));
    case 4:
      return in->flag() ? XmlRpcValue(in->raw<int>()) : XmlRpcValue();
    case 5: {
      XmlRpcValue list;
      const int count = static_cast<int>(in->below(4));
      list.setSize(count);
      for (int i = 0; i < count; ++i) list[i] = value_from(in, depth + 1);
      return list;
    }
    default: {
      XmlRpcValue tree;
      for (std::size_t i = in->below(5); i > 0; --i) {
        const std::string key = name(in);
        tree[key] = value_from(in, depth + 1);
      }
      return tree;
    }
  }
}

void check_query(const ist::QueryConfig& query) {
  FUZZ_CHECK(query.max_distance > 0.0 && query.max_distance <= 1e3, "max_distance %g",
             query.max_distance);
  FUZZ_CHECK(query.tolerance >= 0.0 && query.tolerance <= 1.0, "tolerance %g", query.tolerance);
  FUZZ_CHECK(query.margin >= 0.0 && query.margin <= 1.0, "margin %g", query.margin);
  FUZZ_CHECK(query.deadline >= -1.0 && query.deadline <= 10.0, "deadline %g", query.deadline);
}

void check_repulsion(const ist::RepulsionConfig& repulsion, double max_distance) {
  FUZZ_CHECK(repulsion.influence_distance > 0.0 && repulsion.influence_distance <= max_distance,
             "influence_distance %g", repulsion.influence_distance);
  FUZZ_CHECK(repulsion.gain >= 0.0 && std::isfinite(repulsion.gain), "gain %g", repulsion.gain);
  FUZZ_CHECK(repulsion.smoothing > 0.0 && repulsion.filter_time >= 0.0,
             "smoothing %g, filter_time %g", repulsion.smoothing, repulsion.filter_time);
}

void check_sources(const std::vector<ist::SourceConfig>& sources) {
  for (const ist::SourceConfig& source : sources) {
    FUZZ_CHECK(source.timeout > 0.0, "timeout %g", source.timeout);
    FUZZ_CHECK(source.noise.radius >= 0.0, "noise filter %g", source.noise.radius);
    const ist::Ingest accepted(source.ingest);  // throws where a member is out of its range
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  XmlRpcValue tree;
  for (std::size_t i = in.below(12); i > 0; --i) {
    const std::string key = name(&in);
    tree[key] = value_from(&in, 1);
  }
  try {
    std::vector<std::string> warnings;
    const ist::ServerConfig config = ist::parse_parameters(tree, &warnings);
    check_query(config.query);
    check_repulsion(config.repulsion, config.query.max_distance);
    check_sources(config.sources);
    FUZZ_CHECK(config.rate > 0.0 && config.pose_timeout > 0.0, "rate %g", config.rate);
    FUZZ_CHECK(config.model.packing.max_error > 0.0 && config.model.packing.max_spheres >= 1,
               "packing %g", config.model.packing.max_error);
  } catch (const ist::ParameterError& error) {
    FUZZ_CHECK(error.what()[0] == '~', "no parameter named: %s", error.what());
  }
  // What the tree lacks, or has wrong, keeps the last value.
  ist::ServerConfig last;
  last.query.margin = 0.05;
  ist::LiveReading live = ist::parse_live(tree, last);
  check_query(live.config.query);
  check_repulsion(live.config.repulsion, last.query.max_distance);
  for (const ist::Parameter& one : ist::live_parameters(&live.config)) {
    FUZZ_CHECK(one.is_bool() || one.range.contains(one.number()), "%s is %g", one.name.c_str(),
               one.number());
    FUZZ_CHECK(one.name != "query/margin" || live.found.count(one.name) > 0 || one.number() == 0.05,
               "the margin was lost: %g", one.number());
  }
  return 0;
}
