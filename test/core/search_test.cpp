// Queries of links that have a distance field, against brute force: dense clouds, tolerances,
// motions in small steps and jumps, holes, deadlines.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "support/distance_fields.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kRounding = 2e-8;  // [m] of float, where it decides the side of a point

// A point goes into a cup beside points along its wall, which stay nearer all the time: what is
// kept of the link's distance says nothing of the point that enters.
TEST(SearchByField, APointThatEntersBesideNearerOnesIsFound) {
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
TEST(SearchByField, PointsInsideBeyondTheSurfaceAreFound) {
  test::Rng rng(7);
  const TriangleMesh cups =
      test::joined(test::open_box({0.1, 0.1, 0.1}), test::open_box({0.09, 0.09, 0.09}));
  int contacts = 0;
  for (int round = 0; round < 10; ++round) {
    const Eigen::Isometry3d X_LE = test::random_pose(&rng, 0.0);
    TriangleMesh turned = cups;
    for (Eigen::Vector3d& v : turned.vertices) v = X_LE.inverse() * v;
    const LinkGeometry link = {GeometryElement{turned, X_LE, "cups"}};
    const auto without = test::model_of({link}, 0.01);
    ProximityQuery query(test::with_fields(without, static_cast<std::size_t>(round % 2)), {}),
        other(without, {});
    LinkProximity result;
    for (int k = 0; k < 80; ++k) {
      const std::vector<Eigen::Vector3d> points = {test::random_vector(&rng, 0.08)};
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
TEST(SearchByField, PointsInAHollowAreNotTakenForClear) {
  test::Rng rng(7);
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
      const Eigen::Vector3d middle = test::random_vector(&rng, 0.6);
      const double size = std::pow(10.0, test::uniform(&rng, -3.0, -0.7));
      for (int k = 0; k < 40; ++k) points.push_back(middle + test::random_vector(&rng, size));
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

// A step of the length given, and as much of a turn about the link.
Eigen::Isometry3d step_of(test::Rng* rng, double length) {
  const Eigen::Vector3d way = length * test::random_vector(rng, 1.0).normalized();
  const Eigen::Vector3d axis = test::random_vector(rng, 1.0).normalized();
  return Eigen::Translation3d(way) * Eigen::AngleAxisd(3.0 * length, axis);
}

std::vector<Eigen::Vector3d> random_cluster(test::Rng* rng) {
  const Eigen::Vector3d middle = test::random_vector(rng, 0.3);
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 400; ++k) points.push_back(middle + test::random_vector(rng, 0.2));
  return points;
}

struct Answers {
  int all = 0, near = 0, contacts = 0;
};

// A link moves among points, mostly slowly, sometimes back, sometimes far, and the cloud changes
// now and then. Deadlines leave parts of searches undone.
void expect_motion(const std::shared_ptr<const RobotModel>& model, std::size_t link,
                   const LinkGeometry& geometry, double tolerance, test::Rng* rng,
                   Answers* answers) {
  QueryConfig config;
  config.tolerance = tolerance;
  ProximityQuery query(model, config);
  std::vector<Eigen::Vector3d> points;
  CloudSnapshot cloud;
  Eigen::Isometry3d X_FL = test::random_pose(rng, 0.1);
  const int steps = std::max(test::scaled(120), 8);
  for (int step = 0; step < steps; ++step) {
    if (step % 40 == 0) {
      points = random_cluster(rng);
      cloud = test::make_snapshot(points);
    }
    X_FL = X_FL * step_of(rng, test::power_of_ten(rng, -6.0, step % 10 == 9 ? -1.0 : -3.0));
    config.deadline = step % 7 == 6 ? 1e-6 : 0.0;
    query.set_config(config);
    LinkProximity result;
    SCOPED_TRACE(testing::Message() << "link " << link << ", step " << step);
    const test::Truth truth = test::truth_of(geometry, X_FL, points, cloud);
    if (query.run_link(link, X_FL, {&cloud}, &result)) {
      test::expect_truth(result, truth, config, X_FL, kRounding);
    } else {
      EXPECT_LE(result.lower_bound, std::max(truth.measured, truth.stored) + kRounding);
    }
    if (testing::Test::HasFailure()) return;
    ++answers->all;
    answers->near += result.state == LinkState::kNear ? 1 : 0;
    answers->contacts += result.state == LinkState::kContact ? 1 : 0;
  }
}

TEST(SearchFront, AnswersHoldAlongAMotion) {
  test::Rng rng(11);
  std::vector<LinkGeometry> links = test::random_links(&rng);
  links.push_back(test::one(test::open_box({0.2, 0.2, 0.2})));
  const auto model = test::with_fields(test::model_of(links, 0.02));
  Answers answers;
  for (std::size_t i = 0; i < links.size(); ++i) {
    for (const double tolerance : {0.0, 0.001}) {
      expect_motion(model, i, links[i], tolerance, &rng, &answers);
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(5 * answers.near, answers.all);
  EXPECT_GT(20 * answers.contacts, answers.all);
}

// A box dips into a plane of points, a little tilted otherwise each time: a point that was inside
// is not the deepest one of the next time.
TEST(SearchFront, PointsThatWereInsideAreFoundAgain) {
  test::Rng rng(13);
  const LinkGeometry link = test::one(test::box({0.1, 0.1, 0.1}));
  const auto model = test::with_fields(test::model_of({link}, 0.02));
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 3000; ++k) {
    points.push_back(test::random_vector(&rng, 1.0).cwiseProduct(Eigen::Vector3d(0.1, 0.1, 1e-4)));
  }
  const CloudSnapshot cloud = test::make_snapshot(points);
  for (const double tolerance : {0.0, 1e-4}) {
    QueryConfig config;
    config.tolerance = tolerance;
    ProximityQuery query(model, config);
    LinkProximity result;
    int changes = 0;
    bool was_inside = false;
    for (int step = 0; step < std::max(test::scaled(400), 20); ++step) {
      const Eigen::Vector3d axis = test::random_vector(&rng, 2e-3);
      const double height = 0.05 + 4e-4 * std::sin(0.8 * step);
      const Eigen::Isometry3d X_FL = Eigen::Translation3d(0.0, 0.0, height) *
                                     Eigen::AngleAxisd(axis.norm(), axis.normalized());
      ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
      SCOPED_TRACE(testing::Message() << "step " << step << ", tolerance " << tolerance);
      test::expect_truth(result, test::truth_of(link, X_FL, points, cloud), config, X_FL,
                         kRounding);
      if (HasFailure()) return;
      const bool is_inside = result.state == LinkState::kContact;
      changes += is_inside != was_inside ? 1 : 0;
      was_inside = is_inside;
    }
    EXPECT_GT(changes, 5);
  }
}

}  // namespace
}  // namespace ist
