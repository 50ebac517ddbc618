// packing_outcomes.md states the result for every hostile mesh. This test packs them again and
// checks every certificate against brute force in double precision.
//
// IST_PROXIMITY_UPDATE_DOC=1 writes the table.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <set>
#include <string>

#include "geometry/orientation.h"
#include "internal/packing/packer.h"
#include "internal/packing/packing_check.h"
#include "ist_proximity/geometry/error.h"
#include "support/accuracy.h"
#include "support/hostile_meshes.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/scene.h"

namespace ist {
namespace {

const std::string kDocument =
    std::string(IST_PROXIMITY_SOURCE_DIR) + "/test/core/packing_outcomes.md";
constexpr int kPoints = 300;

bool updating() { return std::getenv("IST_PROXIMITY_UPDATE_DOC") != nullptr; }

// Compares the bounds that a packing gives for a point with the true distance.
void check_point(const TriangleMesh& mesh, const Packing& packing, const Eigen::Vector3d& p,
                 double rounding) {
  const double truth = test::oracle_signed_distance(mesh, p);
  double d_in = 1e300, d_cover = 1e300;
  for (const InnerSphere& sphere : packing.spheres) {
    const double to_center = (p - sphere.center).norm();
    d_in = std::min(d_in, to_center - sphere.radius);
    d_cover = std::min(d_cover, to_center - sphere.cover_radius);
  }
  if (truth < 0.0) {
    ASSERT_LE(d_cover, packing.certificate.interior_gap + rounding) << p.transpose();
    return;
  }
  ASSERT_LE(d_cover, truth + rounding) << p.transpose();
  ASSERT_LE(d_in, truth + packing.certificate.max_gap + rounding) << p.transpose();
}

void check(const TriangleMesh& mesh, const Packing& packing) {
  test::Rng rng(35);
  const Eigen::AlignedBox3d box = test::bounds(mesh);
  const double size = box.sizes().norm(), far = box.center().cwiseAbs().maxCoeff();
  const double rounding = 1e-9 * size + 1e-14 * far;
  for (int i = 0; i < kPoints && !testing::Test::HasFatalFailure(); ++i) {
    const Eigen::Vector3d half = 0.5 * box.sizes() + Eigen::Vector3d::Constant(0.1 * size + 1e-3);
    check_point(mesh, packing, box.center() + half.cwiseProduct(test::random_vector(&rng, 1.0)),
                rounding);
    // Points on the surface itself show the gap.
    const std::size_t t = static_cast<std::size_t>(i) % mesh.triangles.size();
    double u = test::uniform(&rng, 0.0, 1.0), v = test::uniform(&rng, 0.0, 1.0);
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    check_point(mesh, packing,
                mesh.corner(t, 0) + u * (mesh.corner(t, 1) - mesh.corner(t, 0)) +
                    v * (mesh.corner(t, 2) - mesh.corner(t, 0)),
                rounding);
  }
}

// Orients the triangles as load_mesh does, unless it refuses the mesh. Vertices that it would merge
// stay separate.
TriangleMesh as_loaded(TriangleMesh mesh) {
  for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) {
      if (v >= mesh.vertices.size() || !mesh.vertices[v].allFinite()) return mesh;
    }
  }
  const TriangleMesh before = test::merged(mesh);
  TriangleMesh after = before;
  orient_outward(&after);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (after.triangles[t] != before.triangles[t]) {
      std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
    }
  }
  return mesh;
}

// Packs the mesh and returns its row of the table, without the name.
std::string outcome(const test::HostileMesh& hostile) {
  PackingConfig config;
  config.max_error = hostile.max_error;
  try {
    const TriangleMesh mesh = as_loaded(hostile.mesh);
    const Packing packing = pack_mesh(mesh, config);
    EXPECT_TRUE(packing.certificate.reached);
    EXPECT_LE(packing.certificate.max_gap, hostile.max_error);
    check(mesh, packing);
    EXPECT_EQ(packing_fault(mesh, config, packing), "") << "the cache would refuse it";
    const PackingCertificate& certificate = packing.certificate;
    const double sheet_share = certificate.surface_area > 0.0
                                   ? certificate.unreachable_area / certificate.surface_area
                                   : 1.0;
    return "packed | " + std::to_string(packing.spheres.size()) + " | " +
           test::number(1e3 * hostile.max_error) + " | " +
           test::number(std::ceil(1e4 * sheet_share) / 100.0);
  } catch (const ModelError& error) {
    return "refused: " + std::string(error.what()) + " | | " +
           test::number(1e3 * hostile.max_error) + " |";
  }
}

void write_table(const std::string& name, const std::string& table) {
  std::string text = test::read_text(kDocument);
  const auto [first, last] = test::table_place(text, name);
  ASSERT_GT(last, 0U) << name;
  text.replace(first, last - first, table);
  std::ofstream(kDocument) << text;
}

TEST(PackingDocument, HostileMeshesArePackedOrRefusedAsStated) {
  std::string table =
      "| mesh | outcome | spheres | certified below [mm] | surface without inner spheres [%] |\n"
      "|---|---|---|---|---|\n";
  std::set<std::string> names;
  const test::TableRows stated = test::parse_table(test::read_text(kDocument), "hostile meshes");
  for (const test::HostileMesh& hostile : test::hostile_meshes()) {
    SCOPED_TRACE(hostile.name);
    EXPECT_TRUE(names.insert(hostile.name).second) << "two of the same name";
    const std::string result = outcome(hostile);
    table += "| " + hostile.name + " | " + result + " |\n";
    if (updating()) continue;
    bool found = false;
    for (const std::vector<std::string>& row : stated) {
      if (row[0] != hostile.name) continue;
      found = true;
      EXPECT_EQ(result.substr(0, result.find(" |")), row[1]);
      if (result.rfind("packed", 0) != 0) continue;
      // Searches differ between machines in their order, so the number may differ a little.
      const double spheres = std::stod(result.substr(std::string("packed | ").size()));
      EXPECT_NEAR(spheres, std::stod(row[2]), 0.1 * spheres + 2.0);
    }
    EXPECT_TRUE(found) << "not in packing_outcomes.md";
  }
  EXPECT_GE(names.size(), 25U);
  if (updating()) {
    write_table("hostile meshes", table);
  } else {
    EXPECT_EQ(stated.size(), names.size()) << "a row that no test knows";
  }
}

}  // namespace
}  // namespace ist
