#include "ros/parameters/source_config.h"

#include <cmath>

namespace ist {
namespace {

// By type.
constexpr const char* kMessages[] = {"sensor_msgs/PointCloud2", "sensor_msgs/Image",
                                     "sensor_msgs/LaserScan", "octomap_msgs/Octomap",
                                     "ist_proximity/WorldObjects"};
constexpr const char* kNouns[] = {"cloud", "image", "scan", "map", "world"};

}  // namespace

const char* message_type(SourceType type) { return kMessages[static_cast<int>(type)]; }

const char* noun(SourceType type) { return kNouns[static_cast<int>(type)]; }

bool SourceConfig::is_permanent() const {
  const bool stays = type == SourceType::kMap || type == SourceType::kWorld;
  return stays && (!file.empty() || std::isinf(timeout));
}

bool SourceConfig::has_zones() const {
  const bool measures = type != SourceType::kMap && type != SourceType::kWorld;
  return measures && !std::isinf(timeout) && ingest.self_filter_mode != SelfFilterMode::kView;
}

}  // namespace ist
