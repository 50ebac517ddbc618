#include "ist_proximity/facade/obstacles.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "internal/cloud/point_bvh.h"
#include "internal/cloud/unmeasured.h"
#include "internal/facade/sensor_points.h"
#include "internal/robot/coarse_hulls.h"
#include "ist_proximity/proximity/proximity_query.h"
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

void check_box(const Eigen::AlignedBox3d& box) {
  constexpr double kFarthest = 1e9;  // [m]
  const Eigen::Vector3d &low = box.min(), &high = box.max();
  if ((low.array() <= high.array()).all() && low.minCoeff() > -kFarthest &&
      high.maxCoeff() < kFarthest) {
    return;
  }
  std::ostringstream text;
  text << "a box of a map reaches from (" << low.transpose() << ") to (" << high.transpose()
       << ") m: it is empty, or not within 10^9 m.";
  throw std::invalid_argument(text.str());
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

Obstacles Obstacles::from_cloud(const RawCloud& cloud, const ObstaclesConfig& config) {
  return Obstacles(index(cloud, config));
}

Obstacles Obstacles::from_boxes(const std::vector<Eigen::AlignedBox3d>& boxes,
                                const Eigen::Isometry3d& X_FM) {
  if (!is_rigid(X_FM)) throw std::invalid_argument("X_FM is not a rotation and a translation");
  for (const Eigen::AlignedBox3d& box : boxes) check_box(box);
  auto map = std::make_shared<BoxIndex>();
  map->build(boxes);
  auto snapshot = std::make_shared<CloudSnapshot>();
  snapshot->counts.received = snapshot->counts.used = static_cast<std::uint32_t>(boxes.size());
  snapshot->boxes = std::move(map);
  snapshot->X_FM = X_FM;
  return Obstacles(std::move(snapshot));
}

std::vector<std::uint32_t> Obstacles::indices() const {
  std::vector<std::uint32_t> result;
  result.reserve(snapshot_->index.size());
  const PointBvh& points = snapshot_->index.bvh();
  PointTile scratch;
  for (std::size_t i = 0; i < points.tile_count(); ++i) {
    const PointTile& tile = points.tile(i, &scratch);
    result.insert(result.end(), tile.id, tile.id + tile.count);
  }
  std::sort(result.begin(), result.end());
  return result;
}

Obstacles Obstacles::from_file(const std::string& path, const ObstaclesConfig& config) {
  PointFile file = read_sensor_points(path);
  ObstaclesConfig placed = config;
  placed.X_FS = config.X_FS * file.X_QS;
  return from_cloud(to_cloud(std::move(file)), placed);
}

}  // namespace ist
