// Queries of the robot's minimum, with relative tolerances and in batches, against brute force.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "ist_proximity/proximity/proximity_batch.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kRounding = 1e-6;  // [m]

std::vector<TriangleMesh> link_meshes() {
  return {test::l_shape(0.2, 0.05), test::torus(0.1, 0.03, 24, 12), test::box({0.05, 0.1, 0.2}),
          test::thin_plate(0.1, 0.001), test::icosphere(0.08, 2)};
}

std::shared_ptr<RobotModel> model_of(const std::vector<TriangleMesh>& meshes) {
  return test::make_model({meshes.begin(), meshes.end()}, 0.005);
}

// Half of the points lie in a plane below the links, the others anywhere; fixed frame.
std::vector<Eigen::Vector3d> random_points(test::Rng* rng, int count) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    Eigen::Vector3d p = test::random_vector(rng, 0.6);
    if (i % 2 == 0) p.z() = -0.4;
    points.push_back(p);
  }
  return points;
}

std::vector<Eigen::Isometry3d> random_poses(test::Rng* rng, std::size_t links) {
  std::vector<Eigen::Isometry3d> X_FL(links);
  for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(rng, 0.4);
  return X_FL;
}

double truth_of(const TriangleMesh& mesh, const Eigen::Isometry3d& X_FL,
                const std::vector<Eigen::Vector3d>& points_F) {
  std::vector<Eigen::Vector3d> points_L;
  for (const Eigen::Vector3d& p : points_F) points_L.push_back(X_FL.inverse() * p);
  return test::oracle_minimum(mesh, points_L);
}

// The margin is taken off the bound of every link, that of the nearest and of those that a
// tolerance leaves unsearched because they can hardly be nearer.
TEST(RobotMinimum, KeepsTheMargin) {
  test::Rng rng(37);
  const std::vector<TriangleMesh> meshes = link_meshes();
  const auto model = model_of(meshes);
  const std::vector<bool> known(meshes.size(), true);
  QueryConfig config;
  config.tolerance = 0.1;
  config.margin = 0.12;
  for (int scene = 0; scene < test::scaled(200); ++scene) {
    const std::vector<Eigen::Vector3d> points = random_points(&rng, 20);
    const CloudSnapshot cloud = test::make_snapshot(points);
    const std::vector<Eigen::Isometry3d> X_FL = random_poses(&rng, meshes.size());
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      least = std::min(least, truth_of(meshes[i], X_FL[i], points));
    }
    ProximityQuery query(model, config);
    RobotProximity robot;
    ASSERT_TRUE(query.run_minimum(X_FL, known, {&cloud}, &robot));
    ASSERT_LE(robot.nearest.lower_bound, least - config.margin) << scene;
  }
}

TEST(RobotMinimum, ReportsUnknownLinks) {
  const auto model = model_of({test::box({0.2, 0.2, 0.2}), test::box({0.2, 0.2, 0.2})});
  ProximityQuery query(model, {});
  std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
  X_FL[1].translation().x() = 0.3;
  const CloudSnapshot cloud = test::make_snapshot({{0.6, 0, 0}}), nothing = test::make_snapshot({});
  RobotProximity robot;
  query.run_minimum(X_FL, {true, true}, {&cloud}, &robot);
  EXPECT_EQ(robot.link, 1);
  EXPECT_NEAR(robot.nearest.distance, 0.2, kRounding);
  query.run_minimum(X_FL, {true, false}, {&cloud}, &robot);
  EXPECT_EQ(robot.link, 0);
  EXPECT_NEAR(robot.nearest.distance, 0.5, kRounding);
  EXPECT_FALSE(robot.all_known);
  query.run_minimum(X_FL, {false, false}, {&cloud}, &robot);
  EXPECT_EQ(robot.nearest.state, LinkState::kUnknown);
  query.run_minimum(X_FL, {true, true}, {}, &robot);
  EXPECT_EQ(robot.nearest.state, LinkState::kUnknown);
  EXPECT_FALSE(robot.all_known);
  query.run_minimum(X_FL, {true, true}, {&nothing}, &robot);
  EXPECT_EQ(robot.nearest.state, LinkState::kClear);
  EXPECT_EQ(robot.link, -1);
}

TEST(ProximityBatch, EqualsOneQueryPerConfiguration) {
  test::Rng rng(33);
  const auto model = model_of(link_meshes());
  const std::size_t links = model->links.size();
  QueryConfig config;
  config.tolerance = 0.0;
  const CloudSnapshot cloud = test::make_snapshot(random_points(&rng, 500));
  std::vector<bool> known(links, true);
  known[1] = false;
  for (const std::size_t count : {0, 1, 7, 50}) {
    std::vector<Eigen::Isometry3d> X_FL;
    for (std::size_t k = 0; k < count; ++k) {
      for (const Eigen::Isometry3d& X : random_poses(&rng, links)) X_FL.push_back(X);
    }
    for (const int threads : {1, 2, 5}) {
      ProximityBatch batch(model, config, threads);
      std::vector<LinkProximity> results, one;
      std::vector<RobotProximity> minima;
      ASSERT_TRUE(batch.run(X_FL, known, {&cloud}, &results));
      ASSERT_TRUE(batch.run_minimum(X_FL, known, {&cloud}, &minima));
      ASSERT_EQ(results.size(), X_FL.size());
      ASSERT_EQ(minima.size(), count);
      for (std::size_t k = 0; k < count; ++k) {
        const auto first = X_FL.begin() + static_cast<std::ptrdiff_t>(k * links);
        const std::vector<Eigen::Isometry3d> X(first, first + static_cast<std::ptrdiff_t>(links));
        ProximityQuery(model, config).run(X, known, {&cloud}, &one);
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < links; ++i) {
          ASSERT_EQ(results[k * links + i].state, one[i].state);
          if (one[i].state < LinkState::kNear) continue;
          ASSERT_NEAR(results[k * links + i].distance, one[i].distance, 1e-9);
          least = std::min(least, one[i].distance);
        }
        if (std::isinf(least)) continue;
        ASSERT_NEAR(minima[k].nearest.distance, least, 1e-9);
      }
    }
  }
}

}  // namespace
}  // namespace ist
