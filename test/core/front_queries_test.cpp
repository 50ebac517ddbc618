// Queries that begin with the fronts of the last ones, against queries from the root.

#include "proximity/coherence/search_front.h"

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

TEST(SearchFronts, KeepTheMostRecentlyUsed) {
  const auto model = test::make_model({shapes()[0]}, 0.01);
  const DisplacementBound bound(model->links[0]);
  SearchFronts fronts;
  // Uses the front of an index. Returns whether it was that of the last use.
  const auto use = [&](std::uint64_t index) {
    SearchFront* front = fronts.find(index);
    if (front == nullptr) return false;
    const bool known = front->build_id() == index;
    front->begin(index, at(0.0), bound, 0.0F);
    front->add({0.5F, 0.5F, 0, SearchFront::kAllSlots, {}, {}});
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

// What a query has expanded, visited and measured.
std::uint64_t work_of(const ProximityQuery& query) {
  const QueryStatistics& work = query.statistics();
  return work.node_pairs + work.leaf_pairs + work.exact_evaluations;
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
  std::vector<LinkProximity> results, exact_results, ignored;
  std::uint64_t kept = 0, root = 0;
  const int steps = test::scaled(100);
  for (int step = 0; step < steps; ++step) {
    move_links(&rng, step % 25 == 24 ? 0.1 : 5e-4, &X_FL);
    for (CloudSnapshot& snapshot : snapshots) {
      snapshot.X_FM.translation() += test::random_vector(&rng, 1e-4);
    }
    if (step % 47 == 0) snapshots[0] = random_cloud(&rng, 1500);
    ASSERT_TRUE(query.run(X_FL, known, clouds, &results));
    kept += work_of(query);
    ASSERT_TRUE(ProximityQuery(model, exact).run(X_FL, known, clouds, &exact_results));
    ProximityQuery cold(model, config);
    cold.run(X_FL, known, clouds, &ignored);
    root += work_of(cold);
    for (std::size_t i = 0; i < results.size(); ++i) {
      SCOPED_TRACE("step " + std::to_string(step) + ", link " + std::to_string(i));
      ASSERT_NO_FATAL_FAILURE(expect_agrees(results[i], exact_results[i], tolerance, sources > 1));
    }
  }
  std::printf("%lu kept, %lu from the root\n", kept, root);
  EXPECT_LT(kept, 3 * root / 4);
}

// The front keeps the distances of points that were measured.
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
