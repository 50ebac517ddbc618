#include "support/hard_scenes.h"

#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/random_links.h"

namespace ist::test {
namespace {

// The centroids of all faces, the middles of edges, and the vertices: one cloud each.
std::vector<std::vector<Eigen::Vector3d>> feature_points(const TriangleMesh& mesh) {
  std::vector<std::vector<Eigen::Vector3d>> clouds(3);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
    clouds[0].emplace_back((a + b + c) / 3.0);
    clouds[1].emplace_back(0.5 * (a + b));
    clouds[2].push_back(a);
  }
  return clouds;
}

// Each point as a cloud of its own.
std::vector<std::vector<Eigen::Vector3d>> apart(const std::vector<Eigen::Vector3d>& points) {
  std::vector<std::vector<Eigen::Vector3d>> clouds;
  for (const Eigen::Vector3d& p : points) clouds.push_back({p});
  return clouds;
}

}  // namespace

std::vector<HardScene> hard_scenes() {
  using Points = std::vector<Eigen::Vector3d>;
  Rng rng(91);
  const std::vector<LinkGeometry> common = {one(Box{{0.2, 0.1, 0.3}}), one(Cylinder{0.08, 0.25}),
                                            one(Sphere{0.1}), one(l_shape(0.2, 0.05))};
  const TriangleMesh concave = l_shape(0.2, 0.05);
  const auto places = feature_points(concave);
  std::vector<HardScene> scenes = {
      {"points on a surface", {one(concave)}, apart(places[0])},
      {"points on an edge", {one(concave)}, apart(places[1])},
      {"points on a vertex", {one(concave)}, apart(places[2])},
      {"points at a sphere's centre", common, apart({{0, 0, 0}, {1e-300, 0, 0}})},
      {"points on the medial axis", common,
       apart({{0, 0, 0.05}, {0.1, 0.025, 0.025}, {0, 0, -0.1}})},
      {"one point", common, apart({{0.3, 0.2, 0.1}, {0.9, 0, 0}, {3, 3, 3}})},
      {"no point", common, {{}}},
      {"all points the same",
       common,
       {Points(5000, {0.3, 0, 0}), Points(5000, {0.02, 0.01, 0.03})}}};
  Points line, plane, shell;
  for (int i = -50; i <= 50; ++i) {
    line.emplace_back(0.01 * i, 0.13, 0.003 * i);
    for (int k = -10; k <= 10; ++k) plane.emplace_back(0.01 * i, 0.02 * k, -0.16);
  }
  for (const Eigen::Vector3d& v : icosphere(0.5, 4).vertices) shell.push_back(v);
  scenes.push_back({"collinear points", common, {line}});
  scenes.push_back({"coplanar points", common, {plane}});
  scenes.push_back({"inside a closed shell of points", common, {shell}});
  const auto add_near = [&](const std::string& name, const TriangleMesh& mesh) {
    HardScene scene{name, {one(mesh)}, {}};
    for (int i = 0; i < 200; ++i) scene.clouds.push_back(random_points(&rng, scene.links[0], 3));
    scenes.push_back(scene);
  };
  add_near("Chazelle's polyhedron", chazelle(4, 0.002, 0.2));
  add_near("thin plate (0.2 m, 10 um)", thin_plate(0.2, 1e-5));
  add_near("needle (0.3 m, 10 um)", needle(0.3, 1e-5));
  add_near("plate of slivers (1:1500)", sliver_plate(0.3, 0.01, 1e-3, 50));
  add_near("mesh with a hole (open box)", open_box({0.1, 0.1, 0.1}));
  add_near("sheet without thickness", sheet(0.2));
  HardScene concentric{"concentric and equal spheres", {LinkGeometry()}, {}};
  for (int i = 0; i < 20; ++i) concentric.links[0].push_back(one(Sphere{0.01 * (1 + i / 2)})[0]);
  concentric.clouds = apart({{0, 0, 0}, {0.05, 0, 0}, {0.1, 0, 0}, {0.3, 0.1, 0}});
  scenes.push_back(concentric);
  HardScene small{"spheres of radius 1e-6 m to 1 m", {}, {}};
  for (const double radius : {1e-6, 1e-4, 1e-2, 1.0}) small.links.push_back(one(Sphere{radius}));
  small.clouds = apart({{0, 0, 0}, {1e-6, 0, 0}, {1e-4, 1e-5, 0}, {0.9, 0.5, 0}, {1.0, 1.0, 1.0}});
  scenes.push_back(small);
  HardScene edge{"points at max_distance", {one(Sphere{0.1})}, {}};
  for (const double off : {-1e-3, -1e-7, 0.0, 1e-7, 1e-3})
    edge.clouds.push_back({{1.1 + off, 0, 0}});
  scenes.push_back(edge);
  HardScene away{"1e6 m from the origin", common, {line, plane}, {1e6, -2e6, 5e5}};
  scenes.push_back(away);
  return scenes;
}

}  // namespace ist::test
