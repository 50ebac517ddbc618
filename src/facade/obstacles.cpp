#include "ist_proximity/facade/obstacles.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "internal/cloud/unmeasured.h"
#include "internal/facade/sensor_points.h"
#include "internal/robot/coarse_hulls.h"
#include "obstacle_ingest.h"

namespace ist {
namespace {

std::shared_ptr<const CloudSnapshot> index(const RawCloud& cloud, const ObstaclesConfig& config) {
  auto snapshot = std::make_shared<CloudSnapshot>();
  ObstacleIngest(config).run(cloud, snapshot.get());
  const IngestCounts& counts = snapshot->counts;
  if (counts.saw_nothing()) {
    throw std::invalid_argument("of " + std::to_string(counts.received) +
                                " points none was measured: " + unmeasured(counts) +
                                "; where nothing is known, nothing is free. An empty list says "
                                "that there are no obstacles.");
  }
  return snapshot;
}

// The space between a coarse hull and the link that it is drawn around is no part of the robot.
void leave_out_hulls(const RobotDescription& description, const RobotModel& model,
                     std::vector<bool>* known) {
  const auto find = [&](const std::string& name) {
    return std::find_if(model.links.begin(), model.links.end(),
                        [&](const LinkModel& link) { return link.name == name; });
  };
  for (const CoarseHull& hull : coarse_hulls(description, {})) {
    const auto coarse = find(hull.link), fine = find(hull.enclosed);
    if (!hull.is_below || coarse == model.links.end() || fine == model.links.end()) continue;
    (*known)[static_cast<std::size_t>(coarse - model.links.begin())] = false;
  }
}

/// Keeps a copy of the image: its points are read when a query first needs them.
template <class T>
std::shared_ptr<const CloudSnapshot> index_image(const T* xyz, std::size_t width,
                                                 std::size_t height,
                                                 const ObstaclesConfig& config) {
  auto copy = std::make_shared<std::vector<T>>(xyz, xyz + 3 * width * height);
  RawCloud cloud = packed_cloud(copy->data(), width, height);
  cloud.owner = std::move(copy);
  return index(cloud, config);
}

}  // namespace

IngestConfig to_ingest_config(const ObstaclesConfig& config) {
  IngestConfig result;
  result.min_range = config.min_range;
  result.max_range = config.max_range;
  result.self_filter = config.robot != nullptr;
  result.self_filter_padding = config.self_filter_padding;
  result.extent = config.extent;
  return result;
}

ObstacleIngest::ObstacleIngest(const ObstaclesConfig& config)
    : X_FS_(config.X_FS), ingest_(to_ingest_config(config)) {
  if (config.robot == nullptr) return;
  LinkPoses poses = config.robot->link_poses(config.q);
  model_ = config.robot->model();
  leave_out_hulls(config.robot->description(), *model_, &poses.known);
  robot_ = posed_solids(*model_, poses.X_FL, poses.known);
}

void ObstacleIngest::run(const RawCloud& cloud, CloudSnapshot* snapshot) {
  ingest_.run(cloud, X_FS_, robot_, 0.0, snapshot);
}

Obstacles::Obstacles(std::shared_ptr<const CloudSnapshot> snapshot)
    : snapshot_(std::move(snapshot)) {}

Obstacles::Obstacles(Span<const Eigen::Vector3f> points, const ObstaclesConfig& config)
    : Obstacles(index(packed_cloud(reinterpret_cast<const float*>(points.data()), points.size(), 1),
                      config)) {}

Obstacles::Obstacles(Span<const Eigen::Vector3d> points, const ObstaclesConfig& config)
    : Obstacles(index(
          packed_cloud(reinterpret_cast<const double*>(points.data()), points.size(), 1), config)) {
}

Obstacles Obstacles::from_image(const float* xyz, std::size_t width, std::size_t height,
                                const ObstaclesConfig& config) {
  return Obstacles(index_image(xyz, width, height, config));
}

Obstacles Obstacles::from_image(const double* xyz, std::size_t width, std::size_t height,
                                const ObstaclesConfig& config) {
  return Obstacles(index_image(xyz, width, height, config));
}

Obstacles Obstacles::from_file(const std::string& path, const ObstaclesConfig& config) {
  const PointFile file = read_sensor_points(path);
  ObstaclesConfig placed = config;
  placed.X_FS = config.X_FS * file.X_QS;
  if (file.height <= 1) return Obstacles(file.points, placed);
  return from_image(file.points.data()->data(), file.width, file.height, placed);
}

}  // namespace ist
