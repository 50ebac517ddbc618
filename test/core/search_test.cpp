// Queries of links that have a distance field, against brute force: dense clouds, tolerances,
// motions in small steps and jumps, holes, deadlines.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "support/allocations.h"
#include "support/distance_fields.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kRounding = 2e-8;  // [m] of float, where it decides the side of a point

std::vector<std::size_t> all(std::size_t count) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < count; ++i) indices.push_back(i);
  return indices;
}

// Walls, slabs and balls of points about a link; some of them near it, some through it.
std::vector<Eigen::Vector3d> dense_points(test::Rng* rng, int count) {
  const int kind = static_cast<int>(test::uniform(rng, 0, 4));
  const double far = std::pow(10.0, test::uniform(rng, -2.0, 0.3));
  const Eigen::Isometry3d X = test::random_pose(rng, 0.1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d u = test::random_vector(rng, 1.0);
    if (kind == 0) {
      points.push_back(X * Eigen::Vector3d(u.x(), u.y(), far + 0.002 * u.z()));
    } else if (kind == 1) {
      points.push_back(X * Eigen::Vector3d(0.05 * u.normalized() + far * Eigen::Vector3d::UnitX()));
    } else if (kind == 2) {
      points.push_back(X * (far * u.normalized()));
    } else {
      points.push_back(u);
    }
  }
  return points;
}

QueryConfig random_config(test::Rng* rng) {
  constexpr double kTolerances[] = {0.0, 0.001, 0.001, 0.02};
  constexpr double kDistances[] = {0.1, 1.0, 10.0};
  QueryConfig config;
  config.tolerance = kTolerances[static_cast<std::size_t>(test::uniform(rng, 0, 4))];
  config.max_distance = kDistances[static_cast<std::size_t>(test::uniform(rng, 0, 3))];
  return config;
}

class SearchByField : public testing::Test {
 protected:
  SearchByField()
      : links_(test::random_links(&rng_)),
        model_(test::with_fields(test::model_of(links_, 0.02), 2)) {}

  test::Rng rng_{7};
  std::vector<LinkGeometry> links_;
  std::shared_ptr<const RobotModel> model_;
};

TEST_F(SearchByField, BoundsHoldAndZeroToleranceIsExact) {
  ProximityQuery query(model_, {});
  LinkProximity result;
  int contacts = 0, near = 0;
  const int rounds = std::max(test::scaled(40), 2);
  for (int round = 0; round < rounds; ++round) {
    for (const std::size_t i : all(links_.size())) {
      const auto points = dense_points(&rng_, 150);
      const CloudSnapshot cloud = test::make_snapshot(points, test::random_vector(&rng_, 0.1));
      query.set_config(random_config(&rng_));
      Eigen::Isometry3d X_FL = test::random_pose(&rng_, 0.2);
      for (int step = 0; step < 4; ++step) {
        ASSERT_TRUE(query.run_link(i, X_FL, {&cloud}, &result));
        SCOPED_TRACE(testing::Message()
                     << "round " << round << ", link " << i << ", step " << step);
        test::expect_truth(result, test::truth_of(links_[i], X_FL, points, cloud), query.config(),
                           X_FL, kRounding);
        if (HasFailure()) return;
        contacts += result.state == LinkState::kContact ? 1 : 0;
        near += result.state == LinkState::kNear ? 1 : 0;
        // Small steps find what is kept; a jump finds that it is of no use.
        X_FL = X_FL * test::random_pose(&rng_, step == 2 ? 0.3 : 0.002);
      }
    }
  }
  EXPECT_GT(contacts, rounds);
  EXPECT_GT(near, 10 * rounds);
}

// A point that enters a mesh through its hole crosses no surface. It is found to be inside, also
// where what was proven at the steps before is all that is looked at.
TEST_F(SearchByField, APointThatEntersThroughAHoleIsFound) {
  const LinkGeometry cup = test::one(test::open_box({0.1, 0.1, 0.1}));
  const auto model = test::with_fields(test::model_of({cup}, 0.02));
  QueryConfig config;
  config.tolerance = 0.002;
  int contacts = 0;
  for (int round = 0; round < 12; ++round) {
    ProximityQuery query(model, config);
    LinkProximity result;
    // Points in a line that leads into the box, one of its sides at least; and a wall behind.
    const Eigen::Vector3d way = test::random_vector(&rng_, 1.0).normalized();
    std::vector<Eigen::Vector3d> points = {0.2 * way, 0.22 * way};
    const CloudSnapshot cloud = test::make_snapshot(points);
    for (int step = 0; step <= 250; ++step) {
      Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      X_FL.translation() = 0.001 * step * way;
      ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
      SCOPED_TRACE(testing::Message() << "round " << round << ", step " << step);
      test::expect_truth(result, test::truth_of(cup, X_FL, points, cloud), config, X_FL, kRounding);
      if (HasFailure()) return;
      contacts += result.state == LinkState::kContact ? 1 : 0;
    }
  }
  EXPECT_GT(contacts, 100);
}

// The same beside points along a wall, which stay nearer all the time: what is kept of the link's
// distance says nothing of the point that enters.
TEST_F(SearchByField, APointThatEntersBesideNearerOnesIsFound) {
  const LinkGeometry cup = test::one(test::open_box({0.1, 0.1, 0.1}));
  const auto model = test::with_fields(test::model_of({cup}, 0.002));
  QueryConfig config;
  config.tolerance = 0.002;
  int contacts = 0;
  for (int side = 0; side < 6; ++side) {
    const Eigen::Vector3d way = (side < 3 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(side % 3);
    const Eigen::Vector3d beside = Eigen::Vector3d::Unit((side + 1) % 3);
    std::vector<Eigen::Vector3d> points = {0.2 * way};
    for (int k = -300; k <= 500; ++k) points.push_back(0.062 * beside + 0.001 * k * way);
    const CloudSnapshot cloud = test::make_snapshot(points);
    ProximityQuery query(model, config);
    LinkProximity result;
    for (int step = 0; step <= 400; ++step) {
      Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      X_FL.translation() = (0.13 + 0.0001 * step) * way;  // the hole is about the middle
      ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
      SCOPED_TRACE(testing::Message() << "side " << side << ", step " << step);
      test::expect_truth(result, test::truth_of(cup, X_FL, points, cloud), config, X_FL, kRounding);
      if (HasFailure()) return;
      contacts += result.state == LinkState::kContact ? 1 : 0;
    }
  }
  EXPECT_GT(contacts, 100);
}

// The inside of a mesh with holes may reach beyond its surface, up to the box about it in its own
// frame: above the rim of two cups, one in the other.
TEST_F(SearchByField, PointsInsideBeyondTheSurfaceAreFound) {
  const TriangleMesh cups =
      test::joined(test::open_box({0.1, 0.1, 0.1}), test::open_box({0.09, 0.09, 0.09}));
  int contacts = 0;
  for (int round = 0; round < 10; ++round) {
    const Eigen::Isometry3d X_LE = test::random_pose(&rng_, 0.0);
    TriangleMesh turned = cups;
    for (Eigen::Vector3d& v : turned.vertices) v = X_LE.inverse() * v;
    const LinkGeometry link = {GeometryElement{turned, X_LE, "cups"}};
    const auto without = test::model_of({link}, 0.01);
    ProximityQuery query(test::with_fields(without, static_cast<std::size_t>(round % 2)), {}),
        other(without, {});
    LinkProximity result;
    for (int k = 0; k < 80; ++k) {
      const std::vector<Eigen::Vector3d> points = {test::random_vector(&rng_, 0.08)};
      const CloudSnapshot cloud = test::make_snapshot(points);
      const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      const test::Truth truth = test::truth_of(link, X_FL, points, cloud);
      SCOPED_TRACE(testing::Message() << "round " << round << ", point " << k);
      for (ProximityQuery* each : {&query, &other}) {
        ASSERT_TRUE(each->run_link(0, X_FL, {&cloud}, &result));
        test::expect_truth(result, truth, each->config(), X_FL, kRounding);
      }
      if (HasFailure()) return;
      contacts += result.state == LinkState::kContact ? 1 : 0;
    }
  }
  EXPECT_GT(contacts, 100);
}

// A large hollow with a hole: a box of points deep inside is far from every surface.
TEST_F(SearchByField, PointsInAHollowAreNotTakenForClear) {
  const LinkGeometry hollow = test::one(test::open_box({1.0, 1.0, 1.0}));
  const auto without = test::model_of({hollow}, 0.05);
  const auto fine = test::with_fields(without), coarse = test::with_fields(without, 1);
  for (const double tolerance : {0.0, 0.001, 0.1}) {
    QueryConfig config;
    config.tolerance = tolerance;
    ProximityQuery of_fine(fine, config), of_coarse(coarse, config);
    LinkProximity result;
    for (int round = 0; round < 50; ++round) {
      std::vector<Eigen::Vector3d> points;
      const Eigen::Vector3d middle = test::random_vector(&rng_, 0.6);
      const double size = std::pow(10.0, test::uniform(&rng_, -3.0, -0.7));
      for (int k = 0; k < 40; ++k) points.push_back(middle + test::random_vector(&rng_, size));
      const CloudSnapshot cloud = test::make_snapshot(points);
      const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      const test::Truth truth = test::truth_of(hollow, X_FL, points, cloud);
      SCOPED_TRACE(testing::Message() << "round " << round << ", tolerance " << tolerance);
      for (ProximityQuery* query : {&of_fine, &of_coarse}) {
        ASSERT_TRUE(query->run_link(0, X_FL, {&cloud}, &result));
        test::expect_truth(result, truth, config, X_FL, kRounding);
      }
      if (HasFailure()) return;
    }
  }
}

// Whatever a deadline leaves, bounds hold.
TEST_F(SearchByField, BoundsHoldWhenItIsStopped) {
  std::vector<LinkProximity> results;
  const std::vector<bool> known(links_.size(), true);
  int stopped = 0;
  for (int round = 0; round < 60; ++round) {
    const auto points = dense_points(&rng_, 400);
    const CloudSnapshot cloud = test::make_snapshot(points);
    QueryConfig config = random_config(&rng_);
    config.deadline = std::pow(10.0, test::uniform(&rng_, -6.0, -3.5));
    ProximityQuery query(model_, config);
    std::vector<Eigen::Isometry3d> X_FL;
    for (std::size_t i = 0; i < links_.size(); ++i) X_FL.push_back(test::random_pose(&rng_, 0.3));
    for (int step = 0; step < 2; ++step) {
      stopped += query.run(X_FL, known, {&cloud}, &results) ? 0 : 1;
      for (const std::size_t i : all(links_.size())) {
        if (results[i].state == LinkState::kUnknown) continue;
        const test::Truth truth = test::truth_of(links_[i], X_FL[i], points, cloud);
        ASSERT_LE(results[i].lower_bound, std::max(truth.measured, 0.0) + kRounding)
            << "round " << round << ", link " << i;
        if (truth.measured < -kRounding)
          ASSERT_LE(results[i].lower_bound, truth.measured + kRounding);
        ASSERT_GE(results[i].distance, std::min(truth.stored, config.max_distance) - kRounding);
      }
      for (Eigen::Isometry3d& X : X_FL) X = X * test::random_pose(&rng_, 0.001);
    }
  }
  EXPECT_GT(stopped, 20);
}

TEST_F(SearchByField, TheMinimumOfAllLinksIsTheSameWithoutFields) {
  const auto without = std::make_shared<RobotModel>(*model_);
  for (LinkModel& link : without->links) link.field = nullptr;
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model_, config), other(without, config);
  const std::vector<bool> known(links_.size(), true);
  RobotProximity one, two;
  for (int round = 0; round < 60; ++round) {
    const CloudSnapshot cloud = test::make_snapshot(dense_points(&rng_, 300));
    std::vector<Eigen::Isometry3d> X_FL;
    for (std::size_t i = 0; i < links_.size(); ++i) X_FL.push_back(test::random_pose(&rng_, 0.4));
    query.run_minimum(X_FL, known, {&cloud}, &one);
    other.run_minimum(X_FL, known, {&cloud}, &two);
    ASSERT_EQ(one.nearest.state, two.nearest.state) << round;
    if (one.link < 0) continue;
    ASSERT_NEAR(one.nearest.distance, two.nearest.distance, 1e-12) << round;
  }
}

// With a tolerance, the nearest point is the only one of a cloud that is measured, nearly always.
TEST_F(SearchByField, MeasuresHardlyMoreThanOnePoint) {
  QueryConfig config;
  config.max_distance = 10.0;
  ProximityQuery query(test::with_fields(model_), config);
  LinkProximity result;
  std::uint64_t measured = 0, queries = 0;
  for (int round = 0; round < 20; ++round) {
    const CloudSnapshot cloud = test::make_snapshot(dense_points(&rng_, 5000));
    for (const std::size_t i : all(links_.size())) {
      query.run_link(i, test::random_pose(&rng_, 0.4), {&cloud}, &result);
      if (!(result.distance > 0.03 && result.distance < 0.3)) continue;
      measured += query.statistics().exact_evaluations;
      ++queries;
    }
  }
  EXPECT_GT(queries, 50U);
  EXPECT_LT(measured, 2 * queries);
}

// Nor in contact, however many points are inside.
TEST_F(SearchByField, MeasuresFewPointsInContact) {
  QueryConfig config;
  LinkProximity result;
  for (const double tolerance : {0.0, 0.001}) {
    config.tolerance = tolerance;
    std::uint64_t measured = 0, queries = 0;
    for (const TriangleMesh& mesh :
         {test::box({0.2, 0.1, 0.15}), test::icosphere(0.1, 3), test::torus(0.12, 0.05, 20, 12),
          test::open_box({0.1, 0.1, 0.1})}) {
      const LinkGeometry link = test::one(mesh);
      ProximityQuery query(test::with_fields(test::model_of({link}, 0.02)), config);
      for (int round = 0; round < 20; ++round) {
        const auto points = dense_points(&rng_, 2000);
        const CloudSnapshot cloud = test::make_snapshot(points);
        const Eigen::Isometry3d X_FL = test::random_pose(&rng_, 0.1);
        ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
        if (!(result.distance < -0.01)) continue;
        measured += query.statistics().exact_evaluations;
        ++queries;
        test::expect_truth(result, test::truth_of(link, X_FL, points, cloud), config, X_FL,
                           kRounding);
        if (HasFailure()) return;
      }
    }
    EXPECT_GT(queries, 8U);
    EXPECT_LT(measured, 15 * queries) << tolerance;
  }
}

TEST_F(SearchByField, AllocatesNothing) {
  ProximityQuery query(model_, {});
  const CloudSnapshot cloud = test::make_snapshot(dense_points(&rng_, 3000));
  LinkProximity result;
  const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  query.run_link(0, X_FL, {&cloud}, &result);
  const long before = test::allocations;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    query.run_link(i, test::random_pose(&rng_, 0.4), {&cloud}, &result);
  }
  EXPECT_EQ(test::allocations, before);
}

}  // namespace
}  // namespace ist
