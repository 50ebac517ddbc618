#include <utility>
#include <vector>

#include "depth_camera.h"
#include "peers/scene.h"

namespace ist::benchmark {

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

}  // namespace ist::benchmark
