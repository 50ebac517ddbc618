// Poses that are not rigid, long motions, random deadlines.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;  // by link

const std::vector<Shape>& shapes() {
  static const std::vector<Shape> kShapes = {
      Box{{0.2, 0.1, 0.3}}, Cylinder{0.08, 0.25}, test::l_shape(0.2, 0.05),
      test::torus(0.1, 0.03, 24, 12), test::open_box({0.1, 0.1, 0.1})};
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
    const double size = std::pow(10.0, test::uniform(&rng, -9, -3));
    for (Eigen::Isometry3d& X : X_FL) {
      X.translation() += test::random_vector(&rng, size);
      X.rotate(Eigen::AngleAxisd(size, test::random_vector(&rng, 1.0).normalized()));
      X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
    }
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

// Expects that a query without a deadline is complete and that its answers, with its warm start,
// are those of a cold start.
void expect_complete(const std::shared_ptr<const RobotModel>& model, const Poses& X_FL,
                     SnapshotSpan clouds, QueryConfig config, ProximityQuery* query,
                     std::vector<LinkProximity>* exact) {
  const std::vector<bool> known(X_FL.size(), true);
  config.deadline = 0.0;
  query->set_config(config);
  ASSERT_TRUE(query->run(X_FL, known, clouds, exact))
      << "a query without a deadline must be complete";
  std::vector<LinkProximity> cold_results;
  ProximityQuery(model, config).run(X_FL, known, clouds, &cold_results);
  for (std::size_t i = 0; i < exact->size(); ++i) {
    ASSERT_EQ((*exact)[i].state, cold_results[i].state);
    if ((*exact)[i].state == LinkState::kClear) continue;
    ASSERT_NEAR((*exact)[i].distance, cold_results[i].distance, 1e-12);
  }
}

// The true distance [m], or max_distance where the true state is CLEAR.
double true_distance(const LinkProximity& exact, const QueryConfig& config) {
  return exact.state == LinkState::kClear ? config.max_distance : exact.distance;
}

// Expects bounds on both sides of the truth, whether or not the query was complete.
void expect_bounds(const LinkProximity& result, const LinkProximity& exact, bool complete,
                   const QueryConfig& config, const Eigen::Isometry3d& X_FL) {
  const double truth = true_distance(exact, config);
  ASSERT_LE(result.lower_bound, truth + 1e-12);
  if (result.state == LinkState::kUnknown) {
    ASSERT_FALSE(complete);
    ASSERT_TRUE(std::isnan(result.distance));
    return;
  }
  if (result.state == LinkState::kClear) {
    ASSERT_EQ(exact.state, LinkState::kClear);
    return;
  }
  ASSERT_GE(result.distance, truth - 1e-12);
  test::expect_witness(result, X_FL);
}

// Whether the deadline ended the search before the nearest point was measured.
bool is_partial(const LinkProximity& result, const LinkProximity& exact,
                const QueryConfig& config) {
  return result.state >= LinkState::kNear && result.distance > true_distance(exact, config) + 1e-9;
}

// Bounds hold at any deadline. A later query without a deadline is complete again.
TEST(HardMotion, RandomDeadlines) {
  test::Rng rng(74);
  const auto model = test::make_model(shapes(), 0.002);
  const std::vector<bool> known(model->links.size(), true);
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model, config);
  Poses X_FL(model->links.size());
  std::vector<LinkProximity> exact, results;
  const int scenes = test::scaled(200);
  int stopped = 0, partial = 0;
  for (int scene = 0; scene < scenes; ++scene) {
    const CloudSnapshot cloud = random_cloud(&rng, 4000), other = random_cloud(&rng, 100);
    const std::vector<const CloudSnapshot*> clouds = {&cloud, &other};
    for (int k = 0; k < 50; ++k) {
      if (k % 10 == 0) {
        for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.6);
        ASSERT_NO_FATAL_FAILURE(expect_complete(model, X_FL, clouds, config, &query, &exact));
      }
      config.deadline = 1e-6 * std::pow(10.0, test::uniform(&rng, 0.0, 3.0));
      // Half of the queries have a cold start: no bound is known when the deadline passes.
      ProximityQuery cold(model, config);
      query.set_config(config);
      ProximityQuery& stopping = k % 2 == 0 ? cold : query;
      const bool complete = stopping.run(X_FL, known, clouds, &results);
      stopped += complete ? 0 : 1;
      for (std::size_t i = 0; i < results.size(); ++i) {
        ASSERT_NO_FATAL_FAILURE(expect_bounds(results[i], exact[i], complete, config, X_FL[i]));
        partial += is_partial(results[i], exact[i], config) ? 1 : 0;
      }
    }
  }
  EXPECT_GT(stopped, scenes) << "too few deadlines passed for this test to show anything";
  EXPECT_GT(partial, 0);
}

}  // namespace
}  // namespace ist
