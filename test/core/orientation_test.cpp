#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "geometry/orientation.h"
#include "internal/geometry/hole_caps.h"
#include "support/hostile_meshes.h"
#include "support/meshes.h"

namespace ist {
namespace {

using test::inside_out;
using test::joined;
using test::scaled;
using test::shifted;

TriangleMesh oriented(TriangleMesh mesh) {
  orient_outward(&mesh);
  return mesh;
}

// [m^3]
double volume(const TriangleMesh& mesh) { return test::signed_volume(mesh); }

TEST(OrientOutward, FlipsShellsThatAreInsideOut) {
  const TriangleMesh sphere = test::icosphere(0.1, 2), cube = test::box({0.1, 0.1, 0.1});
  const double v = volume(sphere);
  EXPECT_NEAR(volume(oriented(inside_out(sphere))), v, 1e-12);
  EXPECT_NEAR(volume(oriented(shifted(inside_out(sphere), {10, -20, 30}))), v, 1e-9);
  // Two disjoint shells, whichever is the larger.
  for (const TriangleMesh& other : {scaled(sphere, 0.5), scaled(sphere, 2.0)}) {
    const TriangleMesh apart = shifted(other, {0.5, 0, 0});
    const double both = v + volume(other);
    EXPECT_NEAR(volume(oriented(joined(inside_out(sphere), apart))), both, 1e-12);
    EXPECT_NEAR(volume(oriented(joined(sphere, inside_out(apart)))), both, 1e-12);
    EXPECT_NEAR(volume(oriented(inside_out(joined(sphere, apart)))), both, 1e-12);
  }
  // Two shells that touch or intersect.
  EXPECT_NEAR(volume(oriented(joined(cube, shifted(inside_out(cube), {0.1, 0, 0})))), 0.002, 1e-12);
  EXPECT_NEAR(volume(oriented(joined(inside_out(cube), shifted(cube, {0.05, 0, 0})))), 0.002,
              1e-12);
}

TEST(OrientOutward, KeepsCavities) {
  const TriangleMesh sphere = test::icosphere(0.1, 2);
  const TriangleMesh hollow = joined(sphere, inside_out(scaled(sphere, 0.5)));
  const TriangleMesh nested = joined(hollow, scaled(sphere, 0.2));
  EXPECT_NEAR(volume(oriented(hollow)), volume(hollow), 1e-12);
  EXPECT_NEAR(volume(oriented(inside_out(hollow))), volume(hollow), 1e-12);
  EXPECT_NEAR(volume(oriented(nested)), volume(nested), 1e-12);
  EXPECT_NEAR(volume(oriented(inside_out(nested))), volume(nested), 1e-12);
  // One of two solids is inside out, together with its cavity.
  const TriangleMesh two = joined(shifted(inside_out(nested), {0.5, 0, 0}), scaled(hollow, 2.0));
  EXPECT_NEAR(volume(oriented(two)), volume(nested) + volume(scaled(hollow, 2.0)), 1e-12);
}

TEST(OrientOutward, KeepsMeshesWithoutACertainOutside) {
  const TriangleMesh sphere = test::icosphere(0.1, 2);
  const std::vector<std::pair<std::string, TriangleMesh>> meshes = {
      {"nothing", {}},
      {"as it should be", sphere},
      {"open", inside_out(test::open_box({0.3, 0.2, 0.1}))},
      {"a sheet", test::sheet(0.1)},
      {"a sheet seen from both sides",
       test::merged(joined(test::sheet(0.1), inside_out(test::sheet(0.1))))},
      {"every face in both directions", test::merged(joined(sphere, inside_out(sphere)))},
      {"no area", {{{1, 2, 3}}, {{0, 0, 0}}}},
      {"a sphere with an open sheet", joined(sphere, shifted(test::sheet(0.1), {0.2, 0, 0}))},
      {"some faces flipped", test::partly_flipped(sphere, 7)}};
  for (const auto& [name, mesh] : meshes) {
    EXPECT_EQ(oriented(mesh).triangles, mesh.triangles) << name;
  }
}

// Shutdown while a mesh of many shells was oriented waited for it: up to a second of pairs that
// nothing could end.
TEST(OrientOutward, CanBeCancelled) {
  TriangleMesh mesh;  // a row of tetrahedra, every other one inside out
  const TriangleMesh outward{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                             {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
  constexpr int kShells = 2000;
  for (int i = 0; i < kShells; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    const TriangleMesh shell = shifted(i % 2 == 0 ? outward : inside_out(outward), {3.0 * i, 0, 0});
    mesh.vertices.insert(mesh.vertices.end(), shell.vertices.begin(), shell.vertices.end());
    for (TriangleMesh::Triangle t : shell.triangles) {
      for (std::uint32_t& v : t) v += first;
      mesh.triangles.push_back(t);
    }
  }
  int calls = 0;
  TriangleMesh whole = mesh;
  orient_outward(&whole, [&] { return ++calls < 0; });
  EXPECT_NEAR(volume(whole), kShells / 6.0, 1e-6);
  // Two million pairs and more; some thousands of them lie between two calls.
  EXPECT_GT(calls, 400);
  for (const int last : {1, 2, 3, 10, calls}) {
    int asked = 0;
    TriangleMesh part = mesh;
    EXPECT_THROW(orient_outward(&part, [&] { return ++asked >= last; }), Cancelled);
    EXPECT_EQ(asked, last);
    EXPECT_EQ(part.triangles, mesh.triangles) << "what is cancelled changes nothing";
  }
}

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

}  // namespace
}  // namespace ist
