// Traversals that resume the BVTT front of the last one, against traversals from the root.

#include "proximity/coherence/bvtt_front.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "support/box_oracle.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;

const std::vector<Shape>& shapes() {
  static const std::vector<Shape> kShapes = {
      Box{{0.2, 0.1, 0.3}}, Cylinder{0.05, 0.25}, test::l_shape(0.2, 0.05),
      test::torus(0.1, 0.03, 24, 12), test::open_box({0.15, 0.1, 0.2})};
  return kShapes;
}

Eigen::Isometry3d at(double x) { return Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, 0.0)); }

TEST(BvttFront, DisplacementsAddUpUntilItIsDiscarded) {
  const auto model = test::make_model({shapes()[0]}, 0.01);
  const DisplacementBound bound(model->links[0]);
  BvttFront front;
  front.begin(7, at(0.0), bound, 0.0F);
  EXPECT_TRUE(front.empty());
  for (int i = 0; i < 10; ++i) EXPECT_EQ(front.add(i, 0), i);
  front.prune(3, 0.5F);
  front.prune(3, 0.6F);
  front.end(true);
  front.begin(7, at(0.02), bound, 0.0F);
  front.begin(7, at(0.0), bound, 0.0F);
  EXPECT_GE(front.offset(), 0.04F);
  EXPECT_NEAR(front.offset(), 0.04F, 1e-6);
  EXPECT_EQ(front.size(), 10U);
  EXPECT_EQ(front.stored_bounds()[3], 0.5F);
  EXPECT_EQ(front.stored_bounds()[4], kFarAway);
  front.begin(7, at(0.2), bound, 0.0F);
  EXPECT_TRUE(front.empty()) << "the displacement is too large";
  EXPECT_EQ(front.offset(), 0.0F);
  EXPECT_EQ(front.stored_bounds()[3], kFarAway);
  front.add(0, 0);
  front.end(true);
  front.begin(8, at(0.2), bound, 0.0F);
  EXPECT_TRUE(front.empty()) << "another index";
  front.add(0, 0);
  front.end(false);
  front.begin(8, at(0.2), bound, 0.0F);
  EXPECT_TRUE(front.empty()) << "the traversal was stopped";
  front.add(0, 0);
  front.end(true);
  front.begin(8, at(std::numeric_limits<double>::quiet_NaN()), bound, 0.0F);
  EXPECT_TRUE(front.empty()) << "the pose is not finite";
  front.add(0, 0);
  front.end(true);
  front.begin(8, at(0.2), bound, 0.0F);
  EXPECT_TRUE(front.empty()) << "the last pose was not finite";
}

// A bound that a traversal with the one rounding has stored and a traversal with another one reads:
// less the reader's rounding, it is not above what it was less the writer's and the displacement.
TEST(BvttFront, BoundsLoseTheRoundingOfTheirTraversal) {
  const auto model = test::make_model({shapes()[0]}, 0.01);
  const DisplacementBound bound(model->links[0]);
  for (const auto& [written, read] : {std::pair(1e-3F, 1e-5F), std::pair(1e-5F, 1e-3F)}) {
    BvttFront front;
    front.begin(7, at(0.0), bound, written);
    front.prune(front.add(0, 0), 0.5F);
    front.end(true);
    front.begin(7, at(0.02), bound, read);
    const float later = front.stored_bounds()[0] - front.offset();
    EXPECT_LE(later - read, 0.5F - written - 0.02F + 1e-6F);
    EXPECT_NEAR(later - read, 0.5F - written - 0.02F, 2e-6F);
  }
}

TEST(BvttFront, IsDiscardedBeforeItIsFull) {
  const auto model = test::make_model({shapes()[0]}, 0.01);
  const DisplacementBound bound(model->links[0]);
  BvttFront front;
  front.begin(7, at(0.0), bound, 0.0F);
  front.add(0, 0);
  front.end(true);
  std::size_t size = 1;
  for (; !front.empty() && size < 2 * BvttFront::kMaxPairs; ++size) {
    front.add(0, 0);
    front.end(true);
    front.begin(7, at(0.0), bound, 0.0F);
  }
  EXPECT_LT(size, BvttFront::kMaxPairs);
  while (front.add(0, 0) != BvttFront::kFull) {
  }
  EXPECT_EQ(front.size(), BvttFront::kMaxPairs);
}

TEST(BvttFront, TheLeastCoverDistanceStaysUntilAPairIsReopened) {
  const auto model = test::make_model({shapes()[4]}, 0.01);
  const DisplacementBound bound(model->links[0]);
  BvttFront front;
  front.begin(7, at(0.0), bound, 0.0F);
  front.prune(front.add(0, 0), 0.5F);
  EXPECT_EQ(front.stored_cover_bounds()[0], kFarAway);
  front.keep_cover_bound(0, 0.3F);
  front.end(true);
  front.begin(7, at(0.02), bound, 0.0F);
  EXPECT_NEAR(front.stored_cover_bounds()[0] - front.offset(), 0.28F, 1e-6);
  front.keep_cover_bound(0, 0.4F);
  EXPECT_EQ(front.stored_cover_bounds()[0], 0.3F);
  front.reopen(0);
  EXPECT_EQ(front.stored_cover_bounds()[0], kFarAway);
  front.keep_cover_bound(0, 0.4F);
  front.begin(7, at(0.2), bound, 0.0F);
  EXPECT_EQ(front.stored_cover_bounds()[0], kFarAway) << "the front was discarded";
}

TEST(BvttFronts, KeepTheMostRecentlyUsed) {
  const auto model = test::make_model({shapes()[0]}, 0.01);
  const DisplacementBound bound(model->links[0]);
  BvttFronts fronts;
  // Uses the front of an index. Returns whether it was that of the last use.
  const auto use = [&](std::uint64_t index) {
    BvttFront* front = fronts.find(index);
    if (front == nullptr) return false;
    const bool known = front->build_id() == index;
    front->begin(index, at(0.0), bound, 0.0F);
    front->add(0, 0);
    front->end(true);
    return known;
  };
  for (const std::uint64_t index : {1, 2, 3, 4}) EXPECT_FALSE(use(index));
  for (const std::uint64_t index : {1, 3, 2, 4}) EXPECT_TRUE(use(index));
  for (int i = 0; i < 200; ++i) {
    EXPECT_EQ(fronts.find(5), nullptr);
    for (const std::uint64_t index : {1, 2, 3, 4}) EXPECT_TRUE(use(index));
  }
  for (int i = 0; i < 20; ++i) {
    for (const std::uint64_t index : {2, 3, 4}) EXPECT_TRUE(use(index));
  }
  EXPECT_FALSE(use(5)) << "a new front, in place of that of index 1";
  for (const std::uint64_t index : {2, 3, 4, 5}) EXPECT_TRUE(use(index)) << index;
  EXPECT_FALSE(use(1));
  fronts.forget();
  for (const std::uint64_t index : {1, 2, 3, 4}) EXPECT_FALSE(use(index));
  for (const std::uint64_t index : {1, 2, 3, 4}) EXPECT_TRUE(use(index));
}

CloudSnapshot random_cloud(test::Rng* rng, int count) {
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
    sources.push_back(i % 2 == 0 ? random_cloud(rng, 1500) : random_map(rng, 200));
  }
  return sources;
}

// Moves every link by `size` [m] along each axis at most, and turns it by `size` [rad].
void move_links(test::Rng* rng, double size, Poses* X_FL) {
  for (Eigen::Isometry3d& X : *X_FL) {
    X.translation() += test::random_vector(rng, size);
    X.rotate(Eigen::AngleAxisd(size, test::random_vector(rng, 1.0).normalized()));
    X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
  }
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

TEST_P(FrontTrial, AgreeWithTraversalsFromTheRoot) {
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
  std::vector<LinkProximity> results, exact_results, ignored;
  std::uint64_t pairs = 0, root_pairs = 0;
  const int steps = test::scaled(100);
  for (int step = 0; step < steps; ++step) {
    move_links(&rng, step % 25 == 24 ? 0.1 : 5e-4, &X_FL);
    for (CloudSnapshot& snapshot : snapshots) {
      snapshot.X_FM.translation() += test::random_vector(&rng, 1e-4);
    }
    if (step % 47 == 0) snapshots[0] = random_cloud(&rng, 1500);
    ASSERT_TRUE(query.run(X_FL, known, clouds, &results));
    pairs += query.statistics().node_pairs;
    ASSERT_TRUE(ProximityQuery(model, exact).run(X_FL, known, clouds, &exact_results));
    ProximityQuery cold(model, config);
    cold.run(X_FL, known, clouds, &ignored);
    root_pairs += cold.statistics().node_pairs;
    for (std::size_t i = 0; i < results.size(); ++i) {
      SCOPED_TRACE("step " + std::to_string(step) + ", link " + std::to_string(i));
      ASSERT_NO_FATAL_FAILURE(expect_agrees(results[i], exact_results[i], tolerance, sources > 1));
    }
  }
  EXPECT_LT(pairs, 3 * root_pairs / 4);
}

// Points are measured exactly once their cover spheres are nearer than the closest point is. Their
// pairs of leaves keep those distances: without them each of the pairs was visited at every step,
// 8568 in place of 3517 here.
TEST(FrontQueries, MeasuredPointsAreNotVisitedAtEveryStep) {
  test::Rng rng(82);
  const auto model = test::make_model(shapes(), 0.02);
  ProximityQuery query(model, QueryConfig());
  std::vector<Eigen::Vector3d> wall;
  for (int i = 0; i < 20000; ++i) {
    wall.push_back(test::random_vector(&rng, 0.5));
    wall.back().z() = -0.4 + 0.02 * wall.back().z();
  }
  const CloudSnapshot cloud = test::make_snapshot(wall);
  Poses X_FL(model->links.size());
  for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.1);
  std::vector<LinkProximity> results;
  std::uint64_t pairs = 0;
  for (int step = 0; step < 200; ++step) {
    move_links(&rng, 5e-5, &X_FL);
    ASSERT_TRUE(query.run(X_FL, std::vector<bool>(X_FL.size(), true), {&cloud}, &results));
    if (step > 0) pairs += query.statistics().leaf_pairs;
  }
  EXPECT_LT(pairs, 6000U);
}

INSTANTIATE_TEST_SUITE_P(Sources, FrontTrial,
                         ::testing::Combine(::testing::Values(1, 3, 6),
                                            ::testing::Values(0.0, 0.001)));

}  // namespace
}  // namespace ist
