#include <algorithm>
#include <utility>
#include <vector>

#include "depth_camera.h"
#include "internal/geometry/tessellation.h"
#include "peers/scene.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/scene.h"

namespace ist::benchmark {
namespace {

// A pose above the table without contact, and the link's exact distance there.
// @param points_F  in random order, which spares the oracle most of them
std::pair<Eigen::Isometry3d, double> free_pose(const TriangleMesh& mesh,
                                               const std::vector<Eigen::Vector3d>& points_F,
                                               test::Rng* rng) {
  for (;;) {
    Eigen::Isometry3d X_FL = test::random_pose(rng, 0.3);
    X_FL.translation().z() += 0.35;
    const Eigen::Isometry3d X_LF = X_FL.inverse();
    std::vector<Eigen::Vector3d> points_L;
    points_L.reserve(points_F.size());
    for (const Eigen::Vector3d& p : points_F) points_L.push_back(X_LF * p);
    const double distance = test::oracle_minimum(mesh, points_L);
    if (distance > 0.0) return {X_FL, distance};
  }
}

Scene free_scene(const std::vector<TriangleMesh>& meshes, std::size_t configurations) {
  Scene scene{"table", synthetic_frame(), {}};
  std::vector<Eigen::Vector3f> seen;
  read_points(scene.frame, &seen);
  std::vector<Eigen::Vector3d> points_F;
  for (const Eigen::Vector3f& p : seen) points_F.push_back(p.cast<double>());
  test::Rng rng(1);
  std::shuffle(points_F.begin(), points_F.end(), rng);
  for (std::size_t k = 0; k < configurations; ++k) {
    Configuration truth{{}, {}, std::vector<bool>(meshes.size(), false)};
    for (const TriangleMesh& mesh : meshes) {
      const auto [X_FL, distance] = free_pose(mesh, points_F, &rng);
      truth.X_FL.push_back(X_FL);
      truth.distance.push_back(distance);
    }
    scene.configurations.push_back(std::move(truth));
  }
  return scene;
}

}  // namespace

Frame synthetic_frame() {
  const std::vector<std::pair<sim::RayShape, Eigen::Vector3d>> shapes = {
      {sim::RayShape(Box{{1.2, 1.2, 0.05}}), {0.0, 0.0, -0.025}},
      {sim::RayShape(Box{{0.2, 0.15, 0.2}}), {0.2, 0.175, 0.1}},
      {sim::RayShape(Box{{4.0, 0.05, 2.0}}), {0.0, 1.225, 0.0}},
      {sim::RayShape(Sphere{0.08}), {-0.2, 0.1, 0.08}},
      {sim::RayShape(Sphere{0.05}), {0.0, -0.3, 0.05}},
      {sim::RayShape(Sphere{0.03}), {-0.35, -0.2, 0.03}}};
  std::vector<sim::Body> bodies;
  for (const auto& [shape, center] : shapes) {
    bodies.push_back({&shape, Eigen::Isometry3d(Eigen::Translation3d(center))});
  }
  sim::DepthCameraConfig config;
  config.X_FC = sim::looking_at({-0.9, -0.9, 0.9}, {0.0, 0.0, 0.1});
  config.width = 640;
  config.height = 480;
  config.focal_length = 525.0;
  config.max_depth = 10.0;
  config.noise = 0.0;
  sim::Rng rng;
  return make_frame(sim::DepthCamera(config, bodies).picture({}, &rng), config.X_FC);
}

DataSet synthetic_data(const std::string& cache_directory) {
  DataSet set{"synthetic", {{}, cache_directory}, {}, {}};
  set.robot.meshes = {test::torus(0.08, 0.02, 32, 12),
                      test::icosphere(0.06, 2),
                      test::box({0.12, 0.06, 0.04}),
                      test::l_shape(0.12, 0.03),
                      tessellate(Cylinder{0.03, 0.2}, 2e-4).mesh,
                      tessellate(Cylinder{0.06, 0.06}, 2e-4).mesh,
                      test::torus(0.04, 0.015, 24, 12),
                      test::thin_plate(0.12, 0.002)};
  set.scenes.push_back(free_scene(set.robot.meshes, 20));
  std::vector<Poses> waypoints;
  for (std::size_t k = 0; k < 6; ++k) {
    waypoints.push_back(set.scenes.front().configurations[k].X_FL);
  }
  set.motion = interpolated(waypoints, 400);  // about 1 mm a step
  return set;
}

}  // namespace ist::benchmark
