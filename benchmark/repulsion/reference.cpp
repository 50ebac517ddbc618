#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "repulsion/measure.h"
#include "support/tiles.h"

namespace ist::benchmark {
namespace {

using Matrix3X = Eigen::Matrix3Xd;

constexpr int kSamples = 200;         // on a link's surface
constexpr int kInwardSamples = 5000;  // the same, for points inside, which are near the surface

// Points of the exact surface, evenly spread by area, the same in every run.
Matrix3X surface_samples(const LinkGeometry& geometry, int count, std::mt19937_64* rng) {
  struct Triangle {
    Eigen::Vector3d a, b, c;
  };
  std::vector<Triangle> triangles;
  std::vector<double> areas;
  for (const GeometryElement& element : geometry) {
    const auto& mesh = std::get<TriangleMesh>(element.shape);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Eigen::Vector3d a = element.X_LE * mesh.corner(t, 0),
                            b = element.X_LE * mesh.corner(t, 1),
                            c = element.X_LE * mesh.corner(t, 2);
      triangles.push_back({a, b, c});
      areas.push_back((b - a).cross(c - a).norm());
    }
  }
  std::discrete_distribution<std::size_t> choose(areas.begin(), areas.end());
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Matrix3X samples(3, count);
  for (int i = 0; i < count; ++i) {
    const Triangle& t = triangles[choose(*rng)];
    const double root = std::sqrt(unit(*rng)), v = unit(*rng);
    samples.col(i) = (1.0 - root) * t.a + root * (1.0 - v) * t.b + root * v * t.c;
  }
  return samples;
}

Matrix3X thinned_points(const CloudSnapshot& cloud) {
  const auto thinned = test::thinned_points_of(cloud.index);
  Matrix3X points(3, static_cast<Eigen::Index>(thinned.size()));
  Eigen::Index n = 0;
  for (const auto& [id, p] : thinned) points.col(n++) = p;
  return points;
}

// The mean direction from points to samples, weighted as the blend weights its pairs.
Eigen::Vector3d direction(const Matrix3X& samples, const Matrix3X& points, double smoothing) {
  const Eigen::Vector3d middle = samples.rowwise().mean();
  const double radius = (samples.colwise() - middle).colwise().norm().maxCoeff();
  // Points whose weight is zero are skipped.
  const Eigen::RowVectorXd to_middle = (points.colwise() - middle).colwise().norm();
  std::vector<Eigen::Index> near;
  double nearest = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    if (to_middle[i] - radius < nearest + smoothing) near.push_back(i);
    if (near.empty() || near.back() != i) continue;
    nearest = std::min(nearest, (samples.colwise() - points.col(i)).colwise().norm().minCoeff());
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Index i : near) {
    const Matrix3X to_samples = samples.colwise() - points.col(i);
    const Eigen::ArrayXd d = to_samples.colwise().norm().transpose();
    const Eigen::ArrayXd w = (1.0 - (d - nearest) / smoothing).max(0.0).square();
    sum += to_samples * (w / d.max(1e-9)).matrix();
  }
  return sum.normalized();
}

}  // namespace

namespace {

// The sum of the angles [deg] between at(k) and at(k - 1), over the steps that count.
template <typename At>
double variation(const std::vector<std::vector<bool>>& counts, std::size_t link, const At& at) {
  double sum = 0.0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();  // unless the last step counted
  for (std::size_t k = 1; k < counts.size(); ++k) {
    if (!counts[k][link]) {
      before.setZero();
      continue;
    }
    if (before.isZero()) before = at(k - 1);
    const Eigen::Vector3d now = at(k);
    sum += std::atan2(before.cross(now).norm(), before.dot(now));
    before = now;
  }
  return sum * 180.0 / EIGEN_PI;
}

// A point's weight rises from 0 at the surface to 1 at kFullDepth times its sphere's radius.
Eigen::Vector3d contact_direction(const Solid& solid, const Matrix3X& samples,
                                  const Matrix3X& points_L, double full) {
  const Eigen::Vector3d middle = samples.rowwise().mean();
  const double radius = (samples.colwise() - middle).colwise().norm().maxCoeff();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < points_L.cols(); ++i) {
    const Eigen::Vector3d p = points_L.col(i);
    if ((p - middle).norm() > radius) continue;
    const double depth = -solid.signed_distance(p).distance;
    if (!(depth > 0.0)) continue;
    const Matrix3X out = samples.colwise() - p;
    const Eigen::ArrayXd length = out.colwise().norm().transpose().array().max(1e-6);
    const Eigen::ArrayXd weight = length.pow(-4);
    const Eigen::Vector3d mean = out * (weight / length).matrix() / weight.sum();
    sum -= std::min(depth / full, 1.0) * mean;
  }
  return sum.norm() > 0.0 ? Eigen::Vector3d(sum.normalized()) : sum;
}

}  // namespace

double reference_variation(const MovingScene& scene, const std::vector<std::vector<bool>>& counts) {
  std::mt19937_64 rng(5);
  const Matrix3X points = thinned_points(scene.cloud);
  double sum = 0.0;
  for (std::size_t link = 0; link < scene.robot.links.size(); ++link) {
    const Matrix3X samples = surface_samples(scene.robot.links[link].geometry, kSamples, &rng);
    sum += variation(counts, link, [&](std::size_t k) {
      const Eigen::Isometry3d& X_FL = scene.steps[scene.reference_begin + k][link];
      return direction((X_FL.linear() * samples).colwise() + X_FL.translation(), points,
                       RepulsionConfig().smoothing);
    });
  }
  return sum;
}

double wrench_reference_variation(const MovingScene& scene, const RobotModel& model,
                                  const std::vector<std::vector<bool>>& counts) {
  std::mt19937_64 rng(6);
  const Matrix3X points = thinned_points(scene.cloud);
  const double full = kFullDepth * kPointSphereRadius * scene.cloud.thinning;
  double sum = 0.0;
  for (std::size_t link = 0; link < scene.robot.links.size(); ++link) {
    const Matrix3X samples =
        surface_samples(scene.robot.links[link].geometry, kInwardSamples, &rng);
    sum += variation(counts, link, [&](std::size_t k) {
      const Eigen::Isometry3d& X_FL = scene.steps[scene.reference_begin + k][link];
      const Eigen::Isometry3d X_LF = X_FL.inverse();
      return Eigen::Vector3d(
          X_FL.linear() * contact_direction(model.links[link].solid, samples,
                                            (X_LF.linear() * points).colwise() + X_LF.translation(),
                                            full));
    });
  }
  return sum;
}

}  // namespace ist::benchmark
