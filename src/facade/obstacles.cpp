#include "ist_proximity/facade/obstacles.h"

#include <utility>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/robot.h"

namespace ist {
namespace {

std::shared_ptr<const CloudSnapshot> index(const RawCloud& cloud, const ObstaclesConfig& config) {
  IngestConfig ingest_config;
  ingest_config.min_range = config.min_range;
  ingest_config.max_range = config.max_range;
  ingest_config.self_filter = config.robot != nullptr;
  ingest_config.self_filter_padding = config.self_filter_padding;
  ingest_config.extent = config.extent;
  Ingest ingest(ingest_config);
  LinkPoses poses;
  std::vector<PosedSolid> robot;
  if (config.robot != nullptr) {
    poses = config.robot->link_poses(config.q);
    robot = posed_solids(*config.robot->model(), poses.X_FL, poses.known);
  }
  auto snapshot = std::make_shared<CloudSnapshot>();
  ingest.run(cloud, config.X_FS, robot, 0.0, snapshot.get());
  return snapshot;
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
  const PointFile file = read_points(path);
  if (file.height <= 1) return Obstacles(file.points, config);
  return from_image(file.points.data()->data(), file.width, file.height, config);
}

}  // namespace ist
