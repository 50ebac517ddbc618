// Queries of the robot's minimum and of a range without an end.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

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
    std::vector<Eigen::Isometry3d> X_FL(meshes.size());
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.4);
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      least = std::min(least, test::oracle_minimum(test::one(meshes[i]), X_FL[i], points));
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

// A range of +inf has no end, and where there is nothing, nothing is found.
TEST(ProximityQuery, RangeWithoutAnEnd) {
  const auto model = model_of({test::box({0.2, 0.2, 0.2})});
  QueryConfig config;
  config.max_distance = std::numeric_limits<double>::infinity();
  const std::vector<Eigen::Isometry3d> X_FL(1, Eigen::Isometry3d::Identity());
  for (const double margin : {0.0, 0.5}) {
    config.margin = margin;
    ProximityQuery query(model, config);
    const CloudSnapshot nothing = test::make_snapshot({});
    std::vector<LinkProximity> results;
    RobotProximity robot;
    ASSERT_TRUE(query.run(X_FL, {true}, {&nothing}, &results));
    EXPECT_EQ(results[0].state, LinkState::kClear);
    ASSERT_TRUE(query.run_minimum(X_FL, {true}, {&nothing}, &robot));
    EXPECT_EQ(robot.nearest.state, LinkState::kClear);
    for (const double x : {0.3, 50.0, 1e6}) {
      const CloudSnapshot cloud = test::make_snapshot({{x, 0, 0}});
      ASSERT_TRUE(query.run(X_FL, {true}, {&cloud}, &results));
      EXPECT_EQ(results[0].state, LinkState::kNear);
      EXPECT_NEAR(results[0].distance, x - 0.1, 1e-6 * x);
      EXPECT_LE(results[0].lower_bound, x - 0.1 - margin);
      EXPECT_GE(results[0].lower_bound, x - 0.1 - margin - config.tolerance - 1e-6 * x);
    }
  }
}

}  // namespace
}  // namespace ist
