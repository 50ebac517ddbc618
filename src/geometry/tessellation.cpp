#include "internal/geometry/tessellation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <variant>

#include "internal/geometry/numbers.h"

namespace ist {
namespace {

constexpr int kMinSides = 8, kMaxSides = 512;
constexpr int kMaxSubdivisions = 5;
// The largest ratio of height to width of lateral quads.
constexpr double kMaxAspect = 4.0;
// Vertices lie inside the curved surface by this share of its radius, so that rounding cannot put
// one outside; the deviation accounts for it.
constexpr double kInset = 1e-14;

std::uint32_t index_of(std::size_t i) { return static_cast<std::uint32_t>(i); }

int sides_for(double radius, double max_deviation) {
  const double ratio = max_deviation / radius;
  if (!(ratio > 0.0)) return kMaxSides;
  if (ratio >= 1.0) return kMinSides;
  const double sides = std::ceil(kPi / std::acos(1.0 - ratio));
  return static_cast<int>(std::clamp<double>(sides, kMinSides, kMaxSides));
}

// The wall of a prism: rings of `sides` vertices from bottom to top, two triangles to a quad.
void append_wall(int sides, int rings, TriangleMesh* mesh) {
  for (int ring = 0; ring < rings; ++ring) {
    for (int side = 0; side < sides; ++side) {
      const int next = (side + 1) % sides;
      const auto a = static_cast<std::uint32_t>(ring * sides + side);
      const auto b = static_cast<std::uint32_t>(ring * sides + next);
      const auto above = static_cast<std::uint32_t>(sides);
      mesh->triangles.push_back({a, b, b + above});
      mesh->triangles.push_back({a, b + above, a + above});
    }
  }
}

void append_cap(int sides, std::uint32_t first, const Eigen::Vector3d& center, bool top,
                TriangleMesh* mesh) {
  const std::uint32_t middle = index_of(mesh->vertices.size());
  mesh->vertices.push_back(center);
  for (int side = 0; side < sides; ++side) {
    const std::uint32_t a = first + static_cast<std::uint32_t>(side);
    const std::uint32_t b = first + static_cast<std::uint32_t>((side + 1) % sides);
    mesh->triangles.push_back(top ? TriangleMesh::Triangle{middle, a, b}
                                  : TriangleMesh::Triangle{middle, b, a});
  }
}

// The vertices lie on the unit sphere.
TriangleMesh icosahedron() {
  const double golden = 0.5 * (1.0 + std::sqrt(5.0));
  TriangleMesh mesh;
  mesh.vertices = {{-1, golden, 0}, {1, golden, 0}, {-1, -golden, 0}, {1, -golden, 0},
                   {0, -1, golden}, {0, 1, golden}, {0, -1, -golden}, {0, 1, -golden},
                   {golden, 0, -1}, {golden, 0, 1}, {-golden, 0, -1}, {-golden, 0, 1}};
  for (Eigen::Vector3d& v : mesh.vertices) v.normalize();
  mesh.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                    {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                    {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                    {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  return mesh;
}

// Divides each triangle of a mesh on the unit sphere into four, with new vertices on the sphere.
TriangleMesh subdivide(const TriangleMesh& coarse) {
  TriangleMesh fine;
  fine.vertices = coarse.vertices;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [entry, is_new] =
        middles.insert({std::minmax(a, b), index_of(fine.vertices.size())});
    if (is_new) fine.vertices.push_back((fine.vertices[a] + fine.vertices[b]).normalized());
    return entry->second;
  };
  for (const auto& [a, b, c] : coarse.triangles) {
    const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    fine.triangles.insert(fine.triangles.end(),
                          {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  return fine;
}

// The largest distance from a point of the unit sphere to a mesh inscribed in it. The radius to the
// point meets the face below it, at a distance of at most 1 minus that of the face's plane from the
// centre.
double unit_deviation(const TriangleMesh& mesh) {
  double nearest_plane = 1.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d& a = mesh.corner(t, 0);
    const Eigen::Vector3d normal =
        (mesh.corner(t, 1) - a).cross(mesh.corner(t, 2) - a).normalized();
    nearest_plane = std::min(nearest_plane, normal.dot(a));
  }
  return 1.0 - nearest_plane;
}

}  // namespace

Tessellation tessellate(const Box& box) {
  Tessellation result;
  const Eigen::Vector3d half = 0.5 * box.size;
  for (int corner = 0; corner < 8; ++corner) {
    result.mesh.vertices.emplace_back((corner & 1) != 0 ? half.x() : -half.x(),
                                      (corner & 2) != 0 ? half.y() : -half.y(),
                                      (corner & 4) != 0 ? half.z() : -half.z());
  }
  result.mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6},   // -z, +z
                           {0, 1, 5}, {0, 5, 4}, {2, 6, 7}, {2, 7, 3},   // -y, +y
                           {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};  // -x, +x
  return result;
}

Tessellation tessellate(const Cylinder& cylinder, double max_deviation) {
  const int sides = sides_for(cylinder.radius, max_deviation);
  const double radius = cylinder.radius * (1.0 - kInset);
  const double width = 2.0 * radius * std::sin(kPi / sides);
  // Never more rings than sides: a thin rod needs no millions of triangles.
  const int rings = static_cast<int>(
      std::clamp<double>(std::ceil(cylinder.length / (kMaxAspect * width)), 1, sides));

  Tessellation result;
  const double half = 0.5 * cylinder.length;
  for (int ring = 0; ring <= rings; ++ring) {
    const double z = ring == rings ? half : -half + cylinder.length * ring / rings;
    for (int side = 0; side < sides; ++side) {
      const double angle = 2.0 * kPi * side / sides;
      result.mesh.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
  }
  append_wall(sides, rings, &result.mesh);
  append_cap(sides, 0, -half * Eigen::Vector3d::UnitZ(), false, &result.mesh);
  append_cap(sides, static_cast<std::uint32_t>(rings * sides), half * Eigen::Vector3d::UnitZ(),
             true, &result.mesh);
  result.deviation = cylinder.radius * (1.0 - std::cos(kPi / sides) + 2.0 * kInset);
  return result;
}

Tessellation tessellate(const Sphere& sphere, double max_deviation) {
  Tessellation result;
  result.mesh = icosahedron();
  result.deviation = unit_deviation(result.mesh);
  for (int level = 0; level < kMaxSubdivisions; ++level) {
    if (sphere.radius * result.deviation <= max_deviation) break;
    result.mesh = subdivide(result.mesh);
    result.deviation = unit_deviation(result.mesh);
  }
  for (Eigen::Vector3d& v : result.mesh.vertices) v *= sphere.radius * (1.0 - kInset);
  result.deviation = sphere.radius * (result.deviation + 2.0 * kInset);
  return result;
}

TriangleMesh mesh_of(const Shape& shape, double share) {
  if (const auto* box = std::get_if<Box>(&shape)) return tessellate(*box).mesh;
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return tessellate(*cylinder, share * cylinder->radius).mesh;
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    return tessellate(*sphere, share * sphere->radius).mesh;
  }
  return std::get<TriangleMesh>(shape);
}

}  // namespace ist
