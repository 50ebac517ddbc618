#include "ros/parameters/source_config.h"

#include <cmath>

namespace ist {

const char* message_type(SourceType type) {
  switch (type) {
    case SourceType::kDepthImage:
      return "sensor_msgs/Image";
    case SourceType::kScan:
      return "sensor_msgs/LaserScan";
    case SourceType::kMap:
      return "octomap_msgs/Octomap";
    case SourceType::kWorld:
      return "ist_proximity/WorldObjects";
    case SourceType::kCloud:
      break;
  }
  return "sensor_msgs/PointCloud2";
}

const char* message_type(const SourceConfig& config) {
  return config.world.is_planning_scene ? kPlanningSceneType : message_type(config.type);
}

const char* noun(SourceType type) {
  switch (type) {
    case SourceType::kDepthImage:
      return "image";
    case SourceType::kScan:
      return "scan";
    case SourceType::kMap:
      return "map";
    case SourceType::kWorld:
      return "world";
    case SourceType::kCloud:
      break;
  }
  return "cloud";
}

double usual_range(SourceType type) { return type == SourceType::kDepthImage ? 10.0 : 100.0; }

bool SourceConfig::is_permanent() const {
  const bool stays = type == SourceType::kMap || type == SourceType::kWorld;
  return stays && (!file.empty() || std::isinf(timeout));
}

}  // namespace ist
