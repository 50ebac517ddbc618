#include "internal/geometry/hole_caps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "internal/geometry/triangle_bvh.h"
#include "support/hostile_meshes.h"
#include "support/scene.h"

namespace ist {
namespace {

// The winding number of any mesh together with its caps is an integer.
TEST(HoleCaps, CloseEveryMesh) {
  std::size_t open_meshes = 0;
  for (const test::HostileMesh& hostile : test::hostile_meshes()) {
    SCOPED_TRACE(hostile.name);
    TriangleMesh mesh = hostile.mesh;
    bool is_mesh = true;
    for (const TriangleMesh::Triangle& t : mesh.triangles) {
      for (const std::uint32_t v : t) {
        is_mesh = is_mesh && v < mesh.vertices.size() && mesh.vertices[v].allFinite();
      }
    }
    if (!is_mesh) continue;
    const std::vector<OpenEdge> open = open_edges(mesh);
    const TriangleMesh caps = hole_caps(mesh, open);
    EXPECT_EQ(caps.triangles.empty(), open.empty());
    if (open.empty()) continue;
    ++open_meshes;
    mesh.triangles.insert(mesh.triangles.end(), caps.triangles.begin(), caps.triangles.end());
    EXPECT_EQ(count_boundary_edges(mesh), 0U);
  }
  EXPECT_GE(open_meshes, 5U);
}

TEST(HoleCaps, CracksAreClosedAcross) {
  // Two halves of a square with a crack of 1 mm between them: no cap is as large as a half.
  TriangleMesh mesh;
  for (const double x : {-0.1, -0.0005, 0.0005, 0.1}) {
    for (int j = 0; j <= 20; ++j) mesh.vertices.emplace_back(x, -0.1 + 0.01 * j, 0.0);
  }
  for (std::uint32_t column : {0U, 2U}) {
    for (std::uint32_t j = 0; j < 20; ++j) {
      const std::uint32_t a = 21 * column + j, b = a + 21;
      mesh.triangles.push_back({a, b, a + 1});
      mesh.triangles.push_back({a + 1, b, b + 1});
    }
  }
  // The halves are joined at both ends.
  mesh.triangles.push_back({21, 42, 22});
  mesh.triangles.push_back({40, 61, 41});
  mesh.triangles.push_back({41, 61, 62});
  const TriangleMesh caps = hole_caps(mesh, open_edges(mesh));
  std::size_t across = 0;
  for (std::size_t t = 0; t < caps.triangles.size(); ++t) {
    double widest = 0.0;
    for (int k = 0; k < 3; ++k) widest = std::max(widest, std::abs(caps.corner(t, k).x()));
    if (widest < 0.001) ++across;
  }
  EXPECT_GE(across, 30U);
}

}  // namespace
}  // namespace ist
