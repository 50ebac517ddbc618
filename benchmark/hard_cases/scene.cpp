#include "hard_cases/scene.h"

#include <utility>
#include <variant>

#include "internal/geometry/tessellation.h"

namespace ist::benchmark {

std::function<Frame(std::size_t, double, std::mt19937_64*)> images_of(std::vector<Patch> surfaces) {
  return [surfaces = std::move(surfaces)](std::size_t points, double noise, std::mt19937_64* rng) {
    Frame frame;
    frame.width = points;
    frame.height = 1;
    frame.data.reserve(4 * points);
    for (const Eigen::Vector3d& p : sample(surfaces, points, noise, rng)) {
      const Eigen::Vector3f q = p.cast<float>();
      frame.data.insert(frame.data.end(), {q.x(), q.y(), q.z(), 0.0F});
    }
    return frame;
  };
}

std::vector<Eigen::Vector3d> vertices_of(const Shape& shape) {
  constexpr double kDeviation = 1e-5;  // [m] of the inscribed mesh
  if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) return mesh->vertices;
  if (const auto* box = std::get_if<Box>(&shape)) return tessellate(*box).mesh.vertices;
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    return tessellate(*sphere, kDeviation).mesh.vertices;
  }
  return tessellate(std::get<Cylinder>(shape), kDeviation).mesh.vertices;
}

}  // namespace ist::benchmark
