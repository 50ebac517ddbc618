#include "support/hostile_meshes.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "support/hard_shapes.h"
#include "support/meshes.h"

namespace ist::test {
namespace {

// The mesh with a separate vertex for each corner of each triangle.
TriangleMesh unwelded(const TriangleMesh& mesh) {
  TriangleMesh soup;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto first = static_cast<std::uint32_t>(soup.vertices.size());
    for (int k = 0; k < 3; ++k) soup.vertices.push_back(mesh.corner(t, k));
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  return soup;
}

// The mesh with `count` triangles without area added: two equal corners, or three in a line.
TriangleMesh with_degenerate_triangles(TriangleMesh mesh, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const TriangleMesh::Triangle t = mesh.triangles[i];
    mesh.vertices.push_back(0.5 * (mesh.vertices[t[0]] + mesh.vertices[t[1]]));
    mesh.triangles.push_back({t[0], t[0], t[1]});
    mesh.triangles.push_back({t[0], static_cast<std::uint32_t>(mesh.vertices.size() - 1), t[1]});
  }
  return mesh;
}

// A box with a wall inside that hangs on an edge: three faces meet there.
TriangleMesh box_with_wall(const Eigen::Vector3d& size) {
  const Eigen::Vector3d h = 0.5 * size;
  TriangleMesh wall;
  wall.vertices = {{0, -h.y(), -h.z()}, {0, h.y(), -h.z()}, {0, h.y(), h.z()}, {0, -h.y(), h.z()}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  return joined(box(size), wall);
}

// The mesh with every corner of every triangle moved by up to `by` [m]: gaps open along all edges.
TriangleMesh cracked(const TriangleMesh& mesh, double by) {
  TriangleMesh soup = unwelded(mesh);
  for (std::size_t i = 0; i < soup.vertices.size(); ++i) {
    const double k = static_cast<double>(i);
    soup.vertices[i] += by / std::sqrt(3.0) *
                        Eigen::Vector3d(std::sin(12.9 * k), std::sin(78.2 * k), std::sin(37.7 * k));
  }
  return soup;
}

}  // namespace

TriangleMesh scaled(TriangleMesh mesh, double scale) {
  for (Eigen::Vector3d& v : mesh.vertices) v *= scale;
  return mesh;
}

TriangleMesh shifted(TriangleMesh mesh, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& v : mesh.vertices) v += by;
  return mesh;
}

TriangleMesh perforated(TriangleMesh mesh, std::size_t n) {
  std::vector<TriangleMesh::Triangle> kept;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % n != 0) kept.push_back(mesh.triangles[t]);
  }
  mesh.triangles = kept;
  return mesh;
}

TriangleMesh partly_flipped(TriangleMesh mesh, std::size_t n) {
  for (std::size_t t = 0; t < mesh.triangles.size(); t += n) {
    std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  }
  return mesh;
}

TriangleMesh merged(const TriangleMesh& mesh) {
  TriangleMesh result;
  std::map<std::array<double, 3>, std::uint32_t> known;
  std::vector<std::uint32_t> index;
  for (const Eigen::Vector3d& v : mesh.vertices) {
    const auto next = static_cast<std::uint32_t>(result.vertices.size());
    const auto [place, is_new] = known.insert({{v.x(), v.y(), v.z()}, next});
    if (is_new) result.vertices.push_back(v);
    index.push_back(place->second);
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    result.triangles.push_back({index[a], index[b], index[c]});
  }
  return result;
}

TriangleMesh moebius_strip(double radius, double width, int count) {
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * EIGEN_PI * i / count;
    const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0.0);
    const Eigen::Vector3d across =
        std::cos(0.5 * angle) * out + std::sin(0.5 * angle) * Eigen::Vector3d::UnitZ();
    mesh.vertices.push_back(radius * out - 0.5 * width * across);
    mesh.vertices.push_back(radius * out + 0.5 * width * across);
  }
  for (int i = 0; i < count; ++i) {
    const auto a = static_cast<std::uint32_t>(2 * i), b = a + 1;
    // The last quad joins the first one with its edges exchanged.
    const bool last = i + 1 == count;
    const std::uint32_t c = last ? 1 : a + 2, d = last ? 0 : a + 3;
    mesh.triangles.push_back({a, b, d});
    mesh.triangles.push_back({a, d, c});
  }
  return mesh;
}

TriangleMesh tube(const Eigen::Vector3d& size) {
  const TriangleMesh whole = box(size);
  TriangleMesh mesh{whole.vertices, {}};
  for (std::size_t t = 0; t < whole.triangles.size(); ++t) {
    const double z = whole.corner(t, 0).z();
    const bool is_end = z == whole.corner(t, 1).z() && z == whole.corner(t, 2).z();
    if (!is_end) mesh.triangles.push_back(whole.triangles[t]);
  }
  return mesh;
}

std::vector<HostileMesh> hostile_meshes() {
  const TriangleMesh sphere = icosphere(0.1, 2), cube = box({0.1, 0.1, 0.1});
  const TriangleMesh sheet_on_edge = shifted(sheet(0.05), {0.12, 0, 0});
  constexpr double k5mm = 0.005;
  return {
      {"L", l_shape(0.2, 0.05), k5mm},
      {"plate as thick as its error", thin_plate(0.1, k5mm), k5mm},
      {"box without a lid", open_box({0.1, 0.1, 0.2}), k5mm},
      {"sphere, every 10th triangle missing", perforated(sphere, 10), k5mm},
      {"half a sphere's triangles missing", perforated(sphere, 2), k5mm},
      {"edge with three faces", box_with_wall({0.2, 0.1, 0.1}), k5mm},
      {"two boxes that share an edge", joined(cube, shifted(cube, {0.1, 0.1, 0})), k5mm},
      {"two boxes that share a corner", joined(cube, shifted(cube, {0.1, 0.1, 0.1})), k5mm},
      {"inside out", inside_out(sphere), k5mm},
      {"two spheres apart, one inside out",
       joined(sphere, shifted(inside_out(sphere), {0.3, 0, 0})), k5mm},
      {"sphere with a cavity, all inside out",
       inside_out(joined(sphere, inside_out(scaled(sphere, 0.5)))), k5mm},
      {"every 7th face flipped", partly_flipped(sphere, 7), k5mm},
      {"every face twice", joined(sphere, sphere), k5mm},
      {"every face in both directions", joined(sphere, inside_out(sphere)), k5mm},
      {"two spheres that pass through each other", joined(sphere, shifted(sphere, {0.1, 0, 0})),
       k5mm},
      {"two boxes that share a face", joined(cube, shifted(cube, {0.1, 0, 0})), k5mm},
      {"torus that passes through itself", torus(0.03, 0.06, 32, 16), k5mm},
      {"two spheres apart", joined(sphere, shifted(sphere, {0.3, 0, 0})), k5mm},
      {"sphere with a cavity", joined(sphere, inside_out(scaled(sphere, 0.5))), k5mm},
      {"sphere in a cavity of a sphere",
       joined(joined(sphere, inside_out(scaled(sphere, 0.8))), scaled(sphere, 0.5)), k5mm},
      {"sphere with a second one buried", joined(sphere, scaled(sphere, 0.5)), k5mm},
      {"no edge shared (triangle soup)", unwelded(sphere), k5mm},
      {"soup whose seams gape by 20 um", cracked(sphere, 1e-5), k5mm},
      {"hollow sphere, wall of 0.5 mm", joined(sphere, inside_out(scaled(sphere, 0.995))), k5mm},
      {"tube without ends", tube({0.1, 0.1, 0.2}), k5mm},
      {"Moebius strip", moebius_strip(0.1, 0.04, 40), k5mm},
      {"60 triangles without area", with_degenerate_triangles(sphere, 30), k5mm},
      {"slivers of 1:1500", sliver_plate(0.3, 0.02, 0.01, 100), k5mm},
      {"needle, 0.3 m by 20 um", needle(0.3, 1e-5), k5mm},
      {"plate, 0.5 mm thick", thin_plate(0.1, 0.0005), k5mm},
      {"plate, 1 um thick", thin_plate(0.1, 1e-6), k5mm},
      {"sheet without volume", sheet(0.1), k5mm},
      {"sphere with a fin", joined(sphere, sheet_on_edge), k5mm},
      {"one triangle", {{{0, 0, 0}, {0.02, 0, 0}, {0, 0.02, 0}}, {{0, 1, 2}}}, 0.001},
      {"one triangle, a line", {{{0, 0, 0}, {0.1, 0, 0}, {0.05, 0, 0}}, {{0, 1, 2}}}, k5mm},
      {"one triangle, a point", {{{1, 2, 3}}, {{0, 0, 0}}}, k5mm},
      {"Chazelle's polyhedron", chazelle(3, 0.002, 0.2), k5mm},
      {"1 mm wide", scaled(sphere, 0.005), 0.0001},
      {"100 m wide", scaled(sphere, 500.0), 2.0},
      {"1 km from the origin", shifted(sphere, {1000.0, 0, 0}), k5mm},
      {"almost 10 km from the origin", shifted(sphere, {-9999.0, 9999.0, 0}), k5mm},
      {"1000 km from the origin", shifted(sphere, {0, 1e6, 0}), k5mm,
       "allowed are finite coordinates of at most 10000 m"},
      {"no triangle", TriangleMesh{}, k5mm, "cannot pack a mesh without triangles"},
      {"a corner that is NaN",
       {{{0, 0, 0}, {NAN, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}},
       k5mm,
       "a corner of triangle 0 is not finite"},
      {"a corner at infinity",
       {{{0, 0, 0}, {INFINITY, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}},
       k5mm,
       "a corner of triangle 0 is not finite"},
      {"a corner that is not there",
       {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 7}}},
       k5mm,
       "triangle 0 names vertex 7 of 3"},
  };
}

}  // namespace ist::test
