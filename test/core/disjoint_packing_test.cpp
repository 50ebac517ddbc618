// Disjoint packings of whole links: no two inner spheres of an element overlap, and none protrudes
// from its element, by more than 1e-6 m.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/mesh_io.h"
#include "internal/packing/packer.h"
#include "internal/packing/packing_report.h"
#include "support/data_dir.h"
#include "support/demo_arm.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/truth.h"

namespace ist {
namespace {

constexpr double kAllowed = 1e-6;  // [m]
constexpr PackingOrder kOrders[] = {PackingOrder::kDisjoint, PackingOrder::kVolume};

// The largest penetration depth, by brute force over all pairs.
double overlap(const std::vector<InnerSphere>& spheres) {
  double deepest = 0.0;
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (spheres[i].radius == 0.0 || spheres[j].radius == 0.0) continue;
      const double distance = (spheres[i].center - spheres[j].center).norm();
      deepest = std::max(deepest, spheres[i].radius + spheres[j].radius - distance);
    }
  }
  return deepest;
}

// A sphere lies inside if its centre does, at a depth of at least its radius.
void expect_inside(const GeometryElement& element, const std::vector<InnerSphere>& spheres) {
  const GeometryElement alone{element.shape, Eigen::Isometry3d::Identity(), element.source};
  const auto* mesh = std::get_if<TriangleMesh>(&element.shape);
  const Solid solid({alone});
  for (const InnerSphere& sphere : spheres) {
    if (sphere.radius == 0.0) continue;
    const double depth = mesh != nullptr ? -test::oracle_signed_distance(*mesh, sphere.center)
                                         : -solid.signed_distance(sphere.center).distance;
    ASSERT_GE(depth, sphere.radius - kAllowed) << sphere.center.transpose();
  }
}

void expect_disjoint(const GeometryElement& element, int max_spheres) {
  for (const PackingOrder order : kOrders) {
    SCOPED_TRACE(element.source + ", order " + std::to_string(static_cast<int>(order)));
    PackingConfig config;
    config.order = order;
    config.max_error = test::packed_to(0.005);
    config.max_spheres = max_spheres;
    const std::vector<InnerSphere> spheres = pack_element(element.shape, config).spheres;
    EXPECT_LE(overlap(spheres), kAllowed);
    expect_inside(element, spheres);
    const PackingReport report =
        measure_packing(Solid({{element.shape, Eigen::Isometry3d::Identity(), ""}}), spheres);
    EXPECT_LE(report.overlap, kAllowed);
    EXPECT_LE(report.protrusion, kAllowed);
    EXPECT_LE(report.filled_volume, 1.01 * report.solid_volume);
  }
}

TEST(DisjointPacking, OfTheDemoArm) {
  std::size_t elements = 0;
  for (const LinkDescription& link : test::demo_robot().links) {
    SCOPED_TRACE(link.name);
    for (const GeometryElement& element : link.geometry) {
      ++elements;
      expect_disjoint(element, test::scaled(120));
    }
  }
  EXPECT_GE(elements, 9U);
}

TEST(DisjointPacking, OfMeshesMadeHere) {
  const std::vector<std::pair<std::string, TriangleMesh>> meshes = {
      {"box", test::box({0.1, 0.2, 0.3})},
      {"L", test::l_shape(0.2, 0.05)},
      {"torus", test::torus(0.1, 0.03, 24, 12)},
      {"hollow sphere",
       test::joined(test::icosphere(0.1, 2), test::inside_out(test::icosphere(0.05, 2)))},
      {"Chazelle's polyhedron", test::chazelle(3, 0.002, 0.2)},
      {"plate, 0.5 mm", test::thin_plate(0.1, 0.0005)}};
  for (const auto& [name, mesh] : meshes) {
    expect_disjoint({mesh, Eigen::Isometry3d::Identity(), name}, test::scaled(200));
  }
}

// These links have up to 2010 boundary edges: spheres could bulge through holes.
TEST(DisjointPacking, OfAPandasLinks) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  for (const std::size_t link : {4, 6, 9}) {
    const auto file = *data / "robots/franka_description/meshes/visual" /
                      (std::string(test::panda_mesh(link)) + ".dae");
    const TriangleMesh mesh = load_mesh(file.string());
    for (const PackingOrder order : kOrders) {
      SCOPED_TRACE(file.string() + ", order " + std::to_string(static_cast<int>(order)));
      PackingConfig config;
      config.order = order;
      config.max_spheres = test::scaled(60);
      const std::vector<InnerSphere> spheres = pack_mesh(mesh, config).spheres;
      EXPECT_LE(overlap(spheres), kAllowed);
      for (const InnerSphere& sphere : spheres) {
        if (sphere.radius == 0.0) continue;
        ASSERT_GT(test::oracle_winding(mesh, sphere.center), 0.5);
        ASSERT_LE(sphere.radius, test::oracle_distance(mesh, sphere.center) + kAllowed);
      }
      const PackingReport report =
          measure_packing(Solid({{mesh, Eigen::Isometry3d::Identity(), ""}}), spheres);
      EXPECT_LE(report.protrusion, kAllowed);
    }
  }
}

}  // namespace
}  // namespace ist
