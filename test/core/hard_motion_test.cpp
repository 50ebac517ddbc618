// Poses that are not rigid, long motions, and motions among moving clouds and maps.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "support/box_oracle.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/trial.h"

namespace ist {
namespace {

const std::vector<Shape>& shapes() {
  static const std::vector<Shape> kShapes = {
      Box{{0.2, 0.1, 0.3}}, Cylinder{0.05, 0.25}, test::l_shape(0.2, 0.05),
      test::torus(0.1, 0.03, 24, 12), test::open_box({0.15, 0.1, 0.2})};
  return kShapes;
}

CloudSnapshot random_cloud(test::Rng* rng, int count) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) points.push_back(test::random_vector(rng, 0.8));
  return test::make_snapshot(points);
}

TEST(HardPoses, RefusesQuaternionsThatAreNotOfUnitLength) {
  test::Rng rng(71);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Isometry3d X = test::random_pose(&rng, 10.0);
    EXPECT_TRUE(is_rigid(X));
    Eigen::Quaterniond q(X.linear());
    for (const double off : {1e-3, -1e-3}) {
      Eigen::Isometry3d X_off = X;
      Eigen::Quaterniond longer = q;
      longer.coeffs() *= 1.0 + off;
      X_off.linear() = longer.toRotationMatrix();  // not normalized
      EXPECT_FALSE(is_rigid(X_off));
      X_off.linear() = longer.normalized().toRotationMatrix();
      EXPECT_TRUE(is_rigid(X_off));
    }
  }
}

TEST(HardPoses, RefusesReflectedScaledAndShearedPoses) {
  test::Rng rng(72);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Isometry3d X = test::random_pose(&rng, 1e6);
    const int axis = i % 3, other = (i + 1) % 3;
    for (const double factor : {-1.0, 1.0 + 1e-5, 1.0 - 1e-5, 2.0, 0.0}) {
      Eigen::Isometry3d X_bad = X;
      X_bad.linear().col(axis) *= factor;
      EXPECT_FALSE(is_rigid(X_bad)) << factor;
    }
    Eigen::Isometry3d X_bad = X;
    X_bad.linear().col(axis) += 1e-5 * X.linear().col(other);
    EXPECT_FALSE(is_rigid(X_bad)) << "sheared";
    for (const double odd : {std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity(), 1e300}) {
      X_bad = X;
      X_bad.linear()(axis, other) = odd;
      EXPECT_FALSE(is_rigid(X_bad)) << odd;
      if (std::isfinite(odd)) continue;
      X_bad = X;
      X_bad.translation()[axis] = odd;
      EXPECT_FALSE(is_rigid(X_bad)) << odd;
    }
  }
}

using Poses = std::vector<Eigen::Isometry3d>;

// Moves every link by `size` [m] along each axis at most, and turns it by `size` [rad].
void move_links(test::Rng* rng, double size, Poses* X_FL) {
  for (Eigen::Isometry3d& X : *X_FL) {
    X.translation() += test::random_vector(rng, size);
    X.rotate(Eigen::AngleAxisd(size, test::random_vector(rng, 1.0).normalized()));
    X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
  }
}

// The last answer is the next query's warm start. Errors must not add up over many small steps.
TEST(HardMotion, WarmStartDoesNotDrift) {
  test::Rng rng(73);
  const auto model = test::make_model(shapes(), 0.005);
  const CloudSnapshot cloud = random_cloud(&rng, 500);
  const std::vector<bool> known(model->links.size(), true);
  QueryConfig exact, coarse;
  exact.tolerance = 0.0;
  ProximityQuery warm(model, exact), warm_coarse(model, coarse);
  std::vector<Eigen::Isometry3d> X_FL(model->links.size());
  for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.3);
  std::vector<LinkProximity> results, coarse_results, cold_results;
  const int steps = test::scaled(100000), interval = test::scaled(1000);
  for (int step = 1; step <= steps; ++step) {
    move_links(&rng, std::pow(10.0, test::uniform(&rng, -9, -3)), &X_FL);
    ASSERT_TRUE(warm.run(X_FL, known, {&cloud}, &results));
    if (step % 16 == 0) warm_coarse.run(X_FL, known, {&cloud}, &coarse_results);
    if (step % interval != 0) continue;
    warm_coarse.run(X_FL, known, {&cloud}, &coarse_results);
    ProximityQuery(model, exact).run(X_FL, known, {&cloud}, &cold_results);
    for (std::size_t i = 0; i < results.size(); ++i) {
      ASSERT_EQ(results[i].state, cold_results[i].state) << "step " << step;
      ASSERT_NEAR(results[i].distance, cold_results[i].distance, 1e-12) << "step " << step;
      ASSERT_NEAR(results[i].lower_bound, cold_results[i].lower_bound, 1e-12) << "step " << step;
      ASSERT_LE(coarse_results[i].lower_bound, cold_results[i].distance);
      ASSERT_GE(coarse_results[i].distance, cold_results[i].distance - 1e-12);
      ASSERT_LE(coarse_results[i].distance, cold_results[i].distance + coarse.tolerance);
    }
  }
}

CloudSnapshot half_flat_cloud(test::Rng* rng, int count) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    Eigen::Vector3d p = test::random_vector(rng, 0.7);
    if (i % 2 == 0) p.z() = -0.5 + 1e-3 * p.x();
    points.push_back(p);
  }
  return test::make_snapshot(points);
}

CloudSnapshot random_map(test::Rng* rng, int count) {
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p = test::random_vector(rng, 0.7);
    boxes.emplace_back(p, p + Eigen::Vector3d::Constant(0.02));
  }
  return test::make_map(boxes, test::random_pose(rng, 0.1));
}

// Makes clouds and maps by turns.
std::vector<CloudSnapshot> random_sources(test::Rng* rng, int count) {
  std::vector<CloudSnapshot> sources;
  for (int i = 0; i < count; ++i) {
    sources.push_back(i % 2 == 0 ? half_flat_cloud(rng, 1500) : random_map(rng, 200));
  }
  return sources;
}

// Expects an answer at `tolerance` that agrees with the one at tolerance 0.
void expect_agrees(const LinkProximity& result, const LinkProximity& exact, double tolerance,
                   bool has_boxes) {
  ASSERT_EQ(result.state, exact.state);
  if (result.state == LinkState::kClear) return;
  // The depth of boxes is found to a resolution only, with either start.
  const double slack = result.state == LinkState::kContact && has_boxes ? 0.01 : 1e-12;
  ASSERT_LE(result.lower_bound, exact.distance + 1e-12);
  ASSERT_GE(result.distance, exact.lower_bound - 1e-12);
  ASSERT_LE(result.distance, exact.distance + tolerance + slack);
  if (result.state == LinkState::kContact) return;
  ASSERT_LE(result.distance - result.lower_bound, tolerance + 3e-6);
}

// The parameters: the number of clouds and maps, in one case more than there are fronts, and the
// tolerance.
class FrontTrial : public ::testing::TestWithParam<std::tuple<int, double>> {};

TEST_P(FrontTrial, AgreeWithQueriesFromTheRoot) {
  const auto [sources, tolerance] = GetParam();
  test::Rng rng(81);
  static const auto model = test::make_model(shapes(), 0.003);
  const std::vector<bool> known(model->links.size(), true);
  QueryConfig config, exact;
  config.tolerance = tolerance;
  exact.tolerance = 0.0;
  ProximityQuery query(model, config);
  std::vector<CloudSnapshot> snapshots = random_sources(&rng, sources);
  std::vector<const CloudSnapshot*> clouds;
  for (const CloudSnapshot& snapshot : snapshots) clouds.push_back(&snapshot);
  Poses X_FL(model->links.size());
  for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.4);
  std::vector<LinkProximity> results, exact_results;
  const int steps = test::scaled(100);
  for (int step = 0; step < steps; ++step) {
    move_links(&rng, step % 25 == 24 ? 0.1 : 5e-4, &X_FL);
    for (CloudSnapshot& snapshot : snapshots) {
      snapshot.X_FM.translation() += test::random_vector(&rng, 1e-4);
    }
    if (step % 47 == 0) snapshots[0] = half_flat_cloud(&rng, 1500);
    ASSERT_TRUE(query.run(X_FL, known, clouds, &results));
    ASSERT_TRUE(ProximityQuery(model, exact).run(X_FL, known, clouds, &exact_results));
    for (std::size_t i = 0; i < results.size(); ++i) {
      SCOPED_TRACE("step " + std::to_string(step) + ", link " + std::to_string(i));
      ASSERT_NO_FATAL_FAILURE(expect_agrees(results[i], exact_results[i], tolerance, sources > 1));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sources, FrontTrial,
                         ::testing::Combine(::testing::Values(1, 3, 6),
                                            ::testing::Values(0.0, 0.001)));

}  // namespace
}  // namespace ist
