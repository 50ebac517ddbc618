// The front of a search: what it keeps, and that answers along a motion are as good with it
// as without.

#include "proximity/coherence/search_front.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/distance_fields.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kRounding = 2e-8;    // [m] as in search_test
constexpr float kFloatError = 2e-7F;  // [m] of stored bounds below 1 m

SearchFront::Part part_of(std::int32_t child, float bound, float outside) {
  return {bound, outside, child, SearchFront::kAllSlots, {}, {}};
}

// The parts of a front, with their bounds at the pose at work; all stay.
std::vector<SearchFront::Part> parts_of(SearchFront* front) {
  std::vector<SearchFront::Part> parts;
  front->remove_if([&](const SearchFront::Part& part) {
    parts.push_back(part);
    return false;
  });
  return parts;
}

class MovingFront : public testing::Test {
 protected:
  // A step along x, which moves every point of the link as far.
  void begin(std::uint64_t build_id, double x, float rounding = 0.0F) {
    front_.begin(build_id, Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, 0.0)), displacement_,
                 rounding);
  }

  DisplacementBound displacement_{
      Eigen::AlignedBox3d(Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones())};
  SearchFront front_;
};

TEST_F(MovingFront, BoundsFallByTheWay) {
  begin(1, 0.0);
  front_.add(part_of(3, 0.5F, 0.4F));
  const std::uint32_t tile = front_.add(part_of(~5, 0.3F, 0.3F));
  front_.lower(tile, 0.2F, 0.35F);
  front_.end(true);
  begin(1, 0.01);
  front_.end(true);
  begin(1, 0.0);  // back again: the way counts
  const auto parts = parts_of(&front_);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_NEAR(parts[0].bound, 0.48F, kFloatError);
  EXPECT_NEAR(parts[0].outside, 0.38F, kFloatError);
  EXPECT_EQ(parts[1].child, ~5);
  EXPECT_NEAR(parts[1].bound, 0.18F, kFloatError);
  EXPECT_NEAR(parts[1].outside, 0.28F, kFloatError);
}

// A bound with a large error that a search with a small one reads is lower by the difference.
TEST_F(MovingFront, BoundsFallByTheRoundingOfTheSearchThatFoundThem) {
  begin(1, 0.0, 1e-3F);
  front_.add(part_of(3, 0.5F, 0.5F));
  front_.end(true);
  begin(1, 0.0, 1e-6F);
  EXPECT_NEAR(parts_of(&front_).front().bound, 0.5F - 1e-3F + 1e-6F, kFloatError);
}

TEST_F(MovingFront, IsEmptyWhereItsBoundsSayNothing) {
  const auto fill = [&] {
    begin(1, 0.0);
    front_.add(part_of(3, 0.5F, 0.4F));
  };
  fill();
  front_.end(true);
  begin(2, 0.0);
  EXPECT_TRUE(front_.empty()) << "another index";
  fill();
  front_.end(true);
  begin(1, 1.0);
  EXPECT_TRUE(front_.empty()) << "far away";
  fill();
  front_.end(true);
  begin(1, std::nan(""));
  EXPECT_TRUE(front_.empty()) << "nowhere";
  fill();
  front_.end(false);
  EXPECT_EQ(front_.build_id(), 0U);
  begin(1, 0.0);
  EXPECT_TRUE(front_.empty()) << "points are in no part";
}

TEST_F(MovingFront, IsDiscardedWhereItHasNoPlace) {
  begin(1, 0.0);
  for (int i = 0; i < 5000; ++i) front_.lower(front_.add(part_of(i, 0.5F, 0.4F)), 0.1F, 0.1F);
  front_.end(true);
  EXPECT_EQ(front_.build_id(), 0U);
  begin(1, 0.0);
  EXPECT_TRUE(front_.empty());
}

// A step of the length given, and as much of a turn about the link.
Eigen::Isometry3d step_of(test::Rng* rng, double length) {
  const Eigen::Vector3d way = length * test::random_vector(rng, 1.0).normalized();
  const Eigen::Vector3d axis = test::random_vector(rng, 1.0).normalized();
  return Eigen::Translation3d(way) * Eigen::AngleAxisd(3.0 * length, axis);
}

// Links with and without holes move among points, mostly slowly, sometimes back, sometimes far, and
// the cloud changes now and then. Deadlines leave parts of searches undone.
TEST(SearchFrontOfAQuery, AnswersHoldAlongAMotion) {
  test::Rng rng(11);
  std::vector<LinkGeometry> links = test::random_links(&rng);
  links.push_back(test::one(test::open_box({0.2, 0.2, 0.2})));
  const auto model = test::with_fields(test::model_of(links, 0.02));
  int near = 0, contacts = 0;
  for (std::size_t i = 0; i < links.size(); ++i) {
    for (const double tolerance : {0.0, 0.001}) {
      QueryConfig config;
      config.tolerance = tolerance;
      ProximityQuery query(model, config);
      std::vector<Eigen::Vector3d> points;
      CloudSnapshot cloud;
      Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.1);
      const int steps = std::max(test::scaled(120), 8);
      for (int step = 0; step < steps; ++step) {
        if (step % 40 == 0) {
          points.clear();
          const Eigen::Vector3d middle = test::random_vector(&rng, 0.3);
          for (int k = 0; k < 400; ++k) points.push_back(middle + test::random_vector(&rng, 0.2));
          cloud = test::make_snapshot(points);
        }
        const double length =
            std::pow(10.0, test::uniform(&rng, -6.0, step % 10 == 9 ? -1.0 : -3.0));
        X_FL = X_FL * step_of(&rng, length);
        config.deadline = step % 7 == 6 ? 1e-6 : 0.0;
        query.set_config(config);
        LinkProximity result;
        SCOPED_TRACE(testing::Message() << "link " << i << ", step " << step);
        const test::Truth truth = test::truth_of(links[i], X_FL, points, cloud);
        if (query.run_link(i, X_FL, {&cloud}, &result)) {
          test::expect_truth(result, truth, config, X_FL, kRounding);
        } else {
          EXPECT_LE(result.lower_bound, std::max(truth.measured, truth.stored) + kRounding);
        }
        if (HasFailure()) return;
        near += result.state == LinkState::kNear ? 1 : 0;
        contacts += result.state == LinkState::kContact ? 1 : 0;
      }
    }
  }
  EXPECT_GT(near, 300);
  EXPECT_GT(contacts, 100);
}

// A box dips into a plane of points, a little tilted otherwise each time: a point that was inside
// is not the deepest one of the next time.
TEST(SearchFrontOfAQuery, PointsThatWereInsideAreFoundAgain) {
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

// Along a slow motion, hardly any node is expanded again.
TEST(SearchFrontOfAQuery, NodesAboveTheFrontAreNotVisited) {
  test::Rng rng(12);
  const auto model =
      test::with_fields(test::model_of({test::one(test::torus(0.12, 0.05, 40, 24))}, 0.02));
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 40000; ++k) {
    const Eigen::Vector3d p = test::random_vector(&rng, 1.0);
    points.emplace_back(p.x(), p.y(), -0.2 + 0.01 * p.z());
  }
  const CloudSnapshot cloud = test::make_snapshot(points);
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model, config);
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  std::uint64_t nodes = 0, fresh_nodes = 0;
  LinkProximity result, other;
  for (int step = 0; step < 100; ++step) {
    X_FL = X_FL * step_of(&rng, 1e-4);
    ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
    ProximityQuery fresh(model, config);
    ASSERT_TRUE(fresh.run_link(0, X_FL, {&cloud}, &other));
    ASSERT_EQ(result.distance, other.distance) << step;
    if (step == 0) continue;
    nodes += query.statistics().node_pairs;
    fresh_nodes += fresh.statistics().node_pairs;
  }
  EXPECT_GT(fresh_nodes, 500U);
  EXPECT_LT(5 * nodes, fresh_nodes);
}

}  // namespace
}  // namespace ist
