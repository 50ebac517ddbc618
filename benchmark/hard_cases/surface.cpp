#include "hard_cases/surface.h"

#include <algorithm>
#include <cmath>

#include "support/hard_shapes.h"
#include "support/meshes.h"

namespace ist::benchmark {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;

Eigen::Vector3d random_direction(std::mt19937_64* rng) {
  std::normal_distribution<double> normal;
  const double x = normal(*rng), y = normal(*rng), z = normal(*rng);
  return Eigen::Vector3d(x, y, z).normalized();
}

}  // namespace

Patch plane_patch(const Eigen::Vector3d& corner, const Eigen::Vector3d& edge_u,
                  const Eigen::Vector3d& edge_v) {
  const Eigen::Vector3d cross = edge_u.cross(edge_v), normal = cross.normalized();
  return {[=](double u, double v) {
            return SurfacePoint{corner + u * edge_u + v * edge_v, normal};
          },
          cross.norm()};
}

Patch tube_patch(double radius, double length) {
  return {[=](double u, double v) {
            const Eigen::Vector3d out(std::cos(kTwoPi * u), std::sin(kTwoPi * u), 0.0);
            return SurfacePoint{radius * out + (v - 0.5) * length * Eigen::Vector3d::UnitZ(), out};
          },
          kTwoPi * radius * length};
}

Patch sphere_patch(double radius) {
  return {[=](double u, double v) {
            const double z = 2.0 * v - 1.0, r = std::sqrt(std::max(0.0, 1.0 - z * z));
            const Eigen::Vector3d out(r * std::cos(kTwoPi * u), r * std::sin(kTwoPi * u), z);
            return SurfacePoint{radius * out, out};
          },
          2.0 * kTwoPi * radius * radius};
}

Patch point_patch(const Eigen::Vector3d& p) {
  return {[=](double /*u*/, double /*v*/) {
            return SurfacePoint{p, Eigen::Vector3d::Zero()};
          },
          1.0};
}

std::vector<Patch> wall_patches(const Eigen::AlignedBox3d& box, bool open) {
  const Eigen::Vector3d &a = box.min(), &b = box.max(), size = box.sizes();
  const Eigen::Vector3d x(size.x(), 0, 0), y(0, size.y(), 0), z(0, 0, size.z());
  std::vector<Patch> patches = {plane_patch(a, x, y), plane_patch(a, x, z), plane_patch(a, y, z),
                                plane_patch(b, -x, -z), plane_patch(b, -y, -z)};
  if (!open) patches.push_back(plane_patch(b, -x, -y));
  return patches;
}

std::vector<Eigen::Vector3d> sample(const std::vector<Patch>& patches, std::size_t count,
                                    double noise, std::mt19937_64* rng) {
  // The R2 sequence (Roberts 2018): multiples of powers of the plastic number's inverse, modulo 1.
  constexpr double kStepU = 0.7548776662466927, kStepV = 0.5698402909980532;
  double whole = 0.0;
  for (const Patch& patch : patches) whole += patch.area;
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector3d> points;
  points.reserve(count);
  double area = 0.0;
  for (const Patch& patch : patches) {
    area += patch.area;
    const auto end = static_cast<std::size_t>(
        std::llround(static_cast<double>(count) * std::min(1.0, area / whole)));
    for (std::size_t i = 0; points.size() < end; ++i) {
      const double u = kStepU * static_cast<double>(i), v = kStepV * static_cast<double>(i);
      const SurfacePoint at = patch.at(u - std::floor(u), v - std::floor(v));
      const Eigen::Vector3d n = at.normal.isZero() ? random_direction(rng) : at.normal;
      points.emplace_back(at.p + noise * normal(*rng) * n);
    }
  }
  return points;
}

TriangleMesh divided_box(const Eigen::Vector3d& size, double edge) {
  TriangleMesh mesh;
  const Eigen::Vector3d h = 0.5 * size;
  const Eigen::Array3i count = (size / edge).array().ceil().cast<int>();
  for (int side = 0; side < 6; ++side) {
    const int axis = side / 2, next = (axis + 1) % 3, last = (axis + 2) % 3;
    const bool is_top = side % 2 == 0;
    const auto corner = [&](int u, int v) {
      Eigen::Vector3d p;
      p[axis] = is_top ? h[axis] : -h[axis];
      p[next] = size[next] * u / count[next] - h[next];
      p[last] = size[last] * v / count[last] - h[last];
      return p;
    };
    test::MeshBuilder face;
    for (int u = 0; u < count[next]; ++u) {
      for (int v = 0; v < count[last]; ++v) {
        const Eigen::Vector3d across = corner(u + 1, v), along = corner(u, v + 1);
        face.quad(corner(u, v), is_top ? across : along, corner(u + 1, v + 1),
                  is_top ? along : across);
      }
    }
    mesh = test::joined(mesh, face.mesh());
  }
  return mesh;
}

TriangleMesh bellows(double radius, double amplitude, double length, int waves) {
  constexpr int kSides = 64, kStepsPerWave = 12;
  test::MeshBuilder builder;
  const int steps = waves * kStepsPerWave;
  const auto corner = [&](int i, int j) {
    const double s = static_cast<double>(i) / steps, angle = kTwoPi * (j % kSides) / kSides;
    const double r = radius + amplitude * std::sin(kTwoPi * waves * s);
    return Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), (s - 0.5) * length);
  };
  for (int i = 0; i < steps; ++i) {
    for (int j = 0; j < kSides; ++j) {
      builder.quad(corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j));
    }
  }
  return builder.mesh();
}

}  // namespace ist::benchmark
