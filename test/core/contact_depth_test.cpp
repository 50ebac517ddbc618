// Signed depth in every contact of the test data: a robot's real meshes, which have holes, pushed
// into depth images. The truth comes from measuring every point in the link's box.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "internal/geometry/mesh_io.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/data_dir.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"
#include "support/trial.h"
#include "support/truth.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct LinkTruth {
  TriangleMesh mesh;
  TriangleBvh bvh;
};

std::vector<LinkTruth> panda_meshes(const std::filesystem::path& data) {
  std::vector<LinkTruth> links;
  for (std::size_t i = 0; i < test::kPandaLinks; ++i) {
    const auto file = data / "robots/franka_description/meshes/visual" /
                      (std::string(test::panda_mesh(i)) + ".dae");
    TriangleMesh mesh = load_mesh(file.string());
    TriangleBvh bvh(mesh);
    links.push_back({std::move(mesh), std::move(bvh)});
  }
  return links;
}

// The file's poses are rounded to float, but the witness identity holds for rotations only.
std::vector<Eigen::Isometry3d> rotations(std::vector<Eigen::Isometry3d> poses) {
  for (Eigen::Isometry3d& X : poses) {
    X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
  }
  return poses;
}

// The smallest signed distance of the points inside; inf when there are none. No bound but the box
// is used. One result in twenty is checked triangle by triangle.
double deepest(const LinkTruth& link, const Eigen::Isometry3d& X_FL,
               const std::vector<Eigen::Vector3d>& points_F, std::size_t* checked) {
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  double depth = kInfinity;
  Eigen::Vector3d witness = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p_F : points_F) {
    const Eigen::Vector3d p_L = X_LF * p_F;
    if (!link.bvh.bounds().contains(p_L) || !(link.bvh.winding_number(p_L) > 0.5)) continue;
    const double distance = -std::sqrt(link.bvh.closest(p_L).distance_sq);
    if (distance >= depth) continue;
    depth = distance;
    witness = p_L;
  }
  if (depth < kInfinity && ++*checked % 20 == 0) {
    // The two winding numbers must agree, so that they decide alike unless they are nearly 0.5.
    const double w = test::oracle_winding(link.mesh, witness);
    EXPECT_NEAR(link.bvh.winding_number(witness), w, 0.01);
    EXPECT_NEAR(test::oracle_distance(link.mesh, witness), -depth, 1e-9);
  }
  return depth;
}

TEST(ContactDepth, EqualsTheTruthInEveryContact) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  const std::vector<LinkTruth> meshes = panda_meshes(*data);
  const auto model = test::panda_model(*data, 0.005);
  const std::vector<bool> known(test::kPandaLinks, true);
  std::size_t contacts = 0, checked = 0, wrong = 0;
  double largest_error = 0.0;
  for (const char* name : {"mosd0", "mosd10", "mosd40"}) {
    const CloudSnapshot cloud = test::truth_cloud(*data, name);
    const std::vector<Eigen::Vector3d> points = test::stored_points(cloud.index);
    for (const char* motion : {"traj", "rand"}) {
      const std::vector<test::TruthCase> cases = test::truth_cases(*data, name, motion);
      QueryConfig exact, coarse;
      exact.max_distance = coarse.max_distance = 10.0;
      exact.tolerance = 0.0;
      coarse.tolerance = 0.005;
      ProximityQuery exact_query(model, exact), coarse_query(model, coarse);
      std::vector<LinkProximity> results, coarse_results;
      for (std::size_t c = 0; c < cases.size(); c += test::kStride) {
        const std::vector<Eigen::Isometry3d> X_FL = rotations(cases[c].X_FL);
        exact_query.run(X_FL, known, {&cloud}, &results);
        coarse_query.run(X_FL, known, {&cloud}, &coarse_results);
        for (std::size_t i = 0; i < results.size(); ++i) {
          if (cases[c].links[i].points_inside == 0) continue;
          SCOPED_TRACE(::testing::Message() << name << " " << motion << " " << c << " link " << i);
          ++contacts;
          const double truth = deepest(meshes[i], X_FL[i], points, &checked);
          const double error = std::abs(results[i].distance - truth);
          largest_error = std::max(largest_error, error);
          if (error > 1e-5) ++wrong;
          EXPECT_LE(error, 1e-5);
          EXPECT_LE(results[i].lower_bound, truth + (std::abs(truth) < 2e-8 ? 2e-8 : 0.0));
          EXPECT_LE(coarse_results[i].lower_bound, truth + (std::abs(truth) < 2e-8 ? 2e-8 : 0.0));
          EXPECT_GE(coarse_results[i].distance, truth - 1e-9);
          test::expect_witness(results[i], X_FL[i]);
        }
      }
    }
  }
  EXPECT_GT(contacts, test::kSanitized ? 30U : 600U);
  EXPECT_EQ(wrong, 0U) << "largest error " << largest_error << " of " << contacts << " contacts";
}

}  // namespace
}  // namespace ist
