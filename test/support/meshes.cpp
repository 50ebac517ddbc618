#include "support/meshes.h"

#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "internal/geometry/tessellation.h"

namespace ist::test {

TriangleMesh box(const Eigen::Vector3d& size) { return tessellate(Box{size}).mesh; }

TriangleMesh icosphere(double radius, int subdivisions) {
  Tessellation sphere = tessellate(Sphere{radius}, 2.0 * radius);
  for (int level = 0; level < subdivisions; ++level) {
    // Each level divides the deviation by about four; a slightly smaller one requires the next.
    sphere = tessellate(Sphere{radius}, 0.9 * sphere.deviation);
  }
  return sphere.mesh;
}

TriangleMesh torus(double major, double minor, int around, int across) {
  constexpr double kTwoPi = 6.28318530717958647692;
  TriangleMesh mesh;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double u = kTwoPi * i / around, v = kTwoPi * j / across;
      const double r = major + minor * std::cos(v);
      mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), minor * std::sin(v));
    }
  }
  const auto index = [&](int i, int j) {
    return static_cast<std::uint32_t>((i % around) * across + j % across);
  };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      mesh.triangles.push_back({index(i, j), index(i + 1, j), index(i + 1, j + 1)});
      mesh.triangles.push_back({index(i, j), index(i + 1, j + 1), index(i, j + 1)});
    }
  }
  return mesh;
}

TriangleMesh open_box(const Eigen::Vector3d& size) {
  TriangleMesh mesh = box(size);
  mesh.triangles.erase(mesh.triangles.begin() + 2, mesh.triangles.begin() + 4);
  return mesh;
}

TriangleMesh thin_plate(double side, double thickness) { return box({side, side, thickness}); }

TriangleMesh sheet(double side) {
  const double h = 0.5 * side;
  return {{{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}}, {{0, 1, 2}, {0, 2, 3}}};
}

TriangleMesh l_shape(double length, double width) {
  const double a = length, w = width;
  const Eigen::Vector2d outline[6] = {{0, 0}, {a, 0}, {a, w}, {w, w}, {w, a}, {0, a}};
  TriangleMesh mesh;
  for (double z : {0.0, w}) {
    for (const Eigen::Vector2d& p : outline) mesh.vertices.emplace_back(p.x(), p.y(), z);
  }
  const TriangleMesh::Triangle cap[4] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
  for (const auto& [i, j, k] : cap) {
    mesh.triangles.push_back({i, k, j});
    mesh.triangles.push_back({i + 6, j + 6, k + 6});
  }
  for (std::uint32_t i = 0; i < 6; ++i) {
    const std::uint32_t j = (i + 1) % 6;
    mesh.triangles.push_back({i, j, j + 6});
    mesh.triangles.push_back({i, j + 6, i + 6});
  }
  return mesh;
}

TriangleMesh moved(TriangleMesh mesh, const Eigen::Isometry3d& X) {
  for (Eigen::Vector3d& v : mesh.vertices) v = X * v;
  return mesh;
}

TriangleMesh joined(TriangleMesh mesh, const TriangleMesh& other) {
  const auto offset = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& [a, b, c] : other.triangles) {
    mesh.triangles.push_back({a + offset, b + offset, c + offset});
  }
  return mesh;
}

TriangleMesh inside_out(TriangleMesh mesh) {
  for (TriangleMesh::Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

Eigen::AlignedBox3d bounds(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& v : mesh.vertices) box.extend(v);
  return box;
}

double surface_area(const TriangleMesh& mesh) {
  double area = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d& a = mesh.corner(t, 0);
    area += 0.5 * (mesh.corner(t, 1) - a).cross(mesh.corner(t, 2) - a).norm();
  }
  return area;
}

double signed_volume(const TriangleMesh& mesh) {
  double volume = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    volume += mesh.corner(t, 0).dot(mesh.corner(t, 1).cross(mesh.corner(t, 2))) / 6.0;
  }
  return volume;
}

std::size_t open_edges(const TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
  for (const TriangleMesh::Triangle& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++uses[{t[k], t[(k + 1) % 3]}];
  }
  std::size_t open = 0;
  for (const auto& [edge, count] : uses) {
    const auto back = uses.find({edge.second, edge.first});
    if (count != 1 || back == uses.end() || back->second != 1) ++open;
  }
  return open;
}

}  // namespace ist::test
