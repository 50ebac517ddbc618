#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <utility>

#include "internal/geometry/tessellation.h"
#include "peers/scene.h"
#include "support/meshes.h"
#include "support/oracle.h"

namespace ist::benchmark {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kConfigurations = 40;

// The distance along the ray from `origin` in direction `d` (unit) to a sphere; inf if it misses.
double hit_sphere(const Eigen::Vector3d& origin, const Eigen::Vector3d& d,
                  const Eigen::Vector3d& center, double radius) {
  const Eigen::Vector3d oc = origin - center;
  const double b = oc.dot(d), c = oc.squaredNorm() - radius * radius;
  const double root = b * b - c;
  return root > 0.0 && -b - std::sqrt(root) > 0.0 ? -b - std::sqrt(root) : kInfinity;
}

double hit_box(const Eigen::Vector3d& origin, const Eigen::Vector3d& d,
               const Eigen::AlignedBox3d& box) {
  const Eigen::Array3d a = (box.min() - origin).array() / d.array();
  const Eigen::Array3d b = (box.max() - origin).array() / d.array();
  const double enter = a.min(b).maxCoeff(), leave = a.max(b).minCoeff();
  return enter > 0.0 && enter < leave ? enter : kInfinity;
}

}  // namespace

Frame synthetic_frame(std::size_t width, std::size_t height) {
  Frame frame;
  frame.width = width;
  frame.height = height;
  const double focal = 525.0 / 640.0 * static_cast<double>(width);  // [pixels]
  const Eigen::Vector3d eye(-0.9, -0.9, 0.9);
  const Eigen::Vector3d forward = (Eigen::Vector3d(0, 0, 0.1) - eye).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  frame.X_FS.linear().col(0) = right;
  frame.X_FS.linear().col(1) = forward.cross(right);
  frame.X_FS.linear().col(2) = forward;
  frame.X_FS.translation() = eye;
  using Corner = Eigen::Vector3d;
  const Eigen::AlignedBox3d table(Corner(-0.6, -0.6, -0.05), Corner(0.6, 0.6, 0.0));
  const Eigen::AlignedBox3d block(Corner(0.1, 0.1, 0.0), Corner(0.3, 0.25, 0.2));
  const Eigen::AlignedBox3d wall(Corner(-2.0, 1.2, -1.0), Corner(2.0, 1.25, 1.0));
  for (std::size_t v = 0; v < frame.height; ++v) {
    for (std::size_t u = 0; u < frame.width; ++u) {
      const Eigen::Vector3d d_S =
          Eigen::Vector3d((static_cast<double>(u) - 0.5 * static_cast<double>(width - 1)) / focal,
                          (static_cast<double>(v) - 0.5 * static_cast<double>(height - 1)) / focal,
                          1.0)
              .normalized();
      const Eigen::Vector3d d = frame.X_FS.linear() * d_S;
      const double range = std::min(
          {hit_box(eye, d, table), hit_box(eye, d, block), hit_box(eye, d, wall),
           hit_sphere(eye, d, {-0.2, 0.1, 0.08}, 0.08), hit_sphere(eye, d, {0.0, -0.3, 0.05}, 0.05),
           hit_sphere(eye, d, {-0.35, -0.2, 0.03}, 0.03)});
      const Eigen::Vector3f p = std::isfinite(range) ? (range * d_S).cast<float>().eval()
                                                     : Eigen::Vector3f::Constant(NAN);
      frame.data.insert(frame.data.end(), {p.x(), p.y(), p.z(), 0.0F});
    }
  }
  return frame;
}

namespace {

struct Enclosing {
  Eigen::Vector3d center;
  double radius;
};

Enclosing enclosing(const TriangleMesh& mesh) {
  Enclosing sphere{test::bounds(mesh).center(), 0.0};
  for (const Eigen::Vector3d& v : mesh.vertices) {
    sphere.radius = std::max(sphere.radius, (v - sphere.center).norm());
  }
  return sphere;
}

// Distance by brute force over points and triangles. Points whose distance to the link's bounding
// sphere is larger are skipped. Negative: a point is within that sphere.
double true_distance(const TriangleMesh& mesh, const Enclosing& sphere,
                     const Eigen::Isometry3d& X_FL, const std::vector<Eigen::Vector3d>& points_F) {
  const Eigen::Vector3d center = X_FL * sphere.center;
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  std::vector<std::pair<double, std::size_t>> bounds;
  for (std::size_t i = 0; i < points_F.size(); ++i) {
    bounds.emplace_back((points_F[i] - center).norm() - sphere.radius, i);
  }
  if (std::min_element(bounds.begin(), bounds.end())->first < 0.0) return -1.0;
  std::sort(bounds.begin(), bounds.end());
  double nearest = kInfinity;
  for (const auto& [bound, i] : bounds) {
    if (bound > nearest) break;
    nearest = std::min(nearest, test::oracle_distance(mesh, X_LF * points_F[i]));
  }
  return nearest;
}

}  // namespace

std::vector<TriangleMesh> synthetic_meshes() {
  return {test::torus(0.08, 0.02, 32, 12),
          test::icosphere(0.06, 2),
          test::box({0.12, 0.06, 0.04}),
          test::l_shape(0.12, 0.03),
          tessellate(Cylinder{0.03, 0.2}, 2e-4).mesh,
          tessellate(Cylinder{0.06, 0.06}, 2e-4).mesh,
          test::torus(0.04, 0.015, 24, 12),
          test::thin_plate(0.12, 0.002)};
}

Eigen::Isometry3d synthetic_pose(std::mt19937_64* rng) {
  std::uniform_real_distribution<double> side(-0.5, 0.5), height(0.05, 0.6);
  std::normal_distribution<double> normal;
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  const double w = normal(*rng), a = normal(*rng), b = normal(*rng), c = normal(*rng);
  X.linear() = Eigen::Quaterniond(w, a, b, c).normalized().toRotationMatrix();
  const double x = side(*rng), y = side(*rng), z = height(*rng);
  X.translation() = Eigen::Vector3d(x, y, z);
  return X;
}

DataSet synthetic_data(const std::string& cache_directory) {
  DataSet set;
  set.name = "synthetic";
  set.robot.cache_directory = cache_directory;
  set.robot.meshes = synthetic_meshes();
  Scene scene{"table", synthetic_frame(640, 480), {}};
  Points stored;
  stored.read(scene.frame);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < stored.size(); ++i) points.push_back(stored.at(i).cast<double>());
  std::mt19937_64 rng(1);
  std::vector<std::vector<Eigen::Isometry3d>> waypoints;
  while (scene.configurations.size() < kConfigurations) {
    Configuration configuration;
    for (const TriangleMesh& mesh : set.robot.meshes) {
      double distance = -1.0;  // until it is certain that there is no contact
      while (distance < 0.0) {
        if (!configuration.X_FL.empty() &&
            configuration.X_FL.size() > configuration.distance.size()) {
          configuration.X_FL.pop_back();
        }
        configuration.X_FL.push_back(synthetic_pose(&rng));
        distance = true_distance(mesh, enclosing(mesh), configuration.X_FL.back(), points);
      }
      configuration.distance.push_back(distance);
      configuration.is_contact.push_back(false);
    }
    waypoints.push_back(configuration.X_FL);
    scene.configurations.push_back(std::move(configuration));
  }
  waypoints.resize(6);
  set.motion = interpolated(waypoints, 400);  // about 1 mm a step
  set.scenes.push_back(std::move(scene));
  return set;
}

}  // namespace ist::benchmark
