#include "ist_proximity/proximity/self_query.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

constexpr double kMaxError = 0.005;  // [m]

QueryConfig config() {
  QueryConfig result;
  result.max_distance = 0.25;
  return result;
}

// The witnesses are `distance` apart. Apart, they are on the surfaces of their links; in contact,
// one is inside its own link and has this signed distance to the other one.
TEST(SelfQuery, witnessesLieOnTheirLinks) {
  test::Rng rng(11);
  std::vector<LinkGeometry> links = test::random_links(&rng);
  links.resize(17);  // the others have holes
  std::vector<LinkPair> pairs;
  for (std::size_t i = 0; i < links.size(); ++i) {
    for (std::size_t k = i + 1; k < links.size(); ++k) pairs.push_back({i, k});
  }
  SelfQuery query(test::model_of(links, kMaxError), pairs, config());
  std::vector<PairProximity> results;
  std::vector<Eigen::Isometry3d> X_FL(links.size());
  const auto signed_distance = [&](std::size_t link, const Eigen::Vector3d& p_F) {
    return test::oracle_signed_distance(links[link], X_FL[link].inverse() * p_F);
  };
  int near = 0, contacts = 0;
  for (int trial = 0; trial < 3; ++trial) {
    for (auto& X : X_FL) X = test::random_pose(&rng, 0.22);
    query.run(X_FL, std::vector<bool>(links.size(), true), &results);
    for (std::size_t i = 0; i < results.size(); ++i) {
      const auto [first, second] = pairs[i];
      const PairProximity& r = results[i];
      SCOPED_TRACE(testing::Message() << "links " << first << ", " << second);
      if (r.state == LinkState::kClear) continue;
      EXPECT_NEAR(r.direction.norm(), 1.0, 1e-9);
      EXPECT_LT((r.p_FCa - r.p_FCb - r.distance * r.direction).norm(), 1e-9);
      if (r.state == LinkState::kNear) {
        ++near;
        EXPECT_LT(std::abs(signed_distance(first, r.p_FCa)), 1e-9);
        EXPECT_LT(std::abs(signed_distance(second, r.p_FCb)), 1e-9);
        continue;
      }
      ++contacts;
      const double of_first = signed_distance(second, r.p_FCa);
      const double of_second = signed_distance(first, r.p_FCb);
      EXPECT_TRUE(
          (std::abs(of_first - r.distance) < 1e-7 && signed_distance(first, r.p_FCa) < 1e-7) ||
          (std::abs(of_second - r.distance) < 1e-7 && signed_distance(second, r.p_FCb) < 1e-7))
          << of_first << " " << of_second << " " << r.distance;
    }
  }
  EXPECT_GT(near, 30);
  EXPECT_GT(contacts, 30);
}

TEST(SelfQuery, spheresAreExact) {
  test::Rng rng(12);
  std::vector<Shape> shapes = {Sphere{0.05}, Sphere{0.1}, Box{{0.1, 0.2, 0.3}},
                               Cylinder{0.05, 0.3}};
  const auto model = test::make_model(shapes, kMaxError);
  const std::vector<LinkPair> pairs = {{0, 1}, {2, 0}, {0, 3}};
  QueryConfig exact = config();
  exact.tolerance = 0.0;
  SelfQuery query(model, pairs, exact);
  std::vector<PairProximity> results;
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<Eigen::Isometry3d> X_FL;
    for (int i = 0; i < 4; ++i) X_FL.push_back(test::random_pose(&rng, 0.25));
    query.run(X_FL, std::vector<bool>(4, true), &results);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const std::size_t other = pairs[i].first == 0 ? pairs[i].second : pairs[i].first;
      const Eigen::Vector3d center = X_FL[other].inverse() * X_FL[0].translation();
      const LinkGeometry solid = test::one(shapes[other]);
      const double truth = test::oracle_signed_distance(solid, center) - 0.05;
      if (results[i].state != LinkState::kNear || truth < 1e-3) continue;
      EXPECT_NEAR(results[i].distance, truth, 1e-9);
      EXPECT_NEAR(results[i].lower_bound, truth, 1e-9);
      EXPECT_LE(results[i].lower_bound, truth + 1e-12);
    }
  }
}

TEST(SelfQuery, aLinkInsideAnotherIsInContact) {
  const auto model = test::make_model({Box{{1.0, 1.0, 1.0}}, Sphere{0.05}}, 0.02);
  for (const LinkPair pair : {LinkPair{0, 1}, LinkPair{1, 0}}) {
    SelfQuery query(model, {pair}, config());
    std::vector<PairProximity> results;
    query.run(std::vector<Eigen::Isometry3d>(2, Eigen::Isometry3d::Identity()), {true, true},
              &results);
    EXPECT_EQ(results[0].state, LinkState::kContact);
    EXPECT_LE(results[0].lower_bound, -0.5);
  }
}

TEST(SelfQuery, unknownPosesAndMargin) {
  const auto model = test::make_model({Sphere{0.1}, Sphere{0.1}, Sphere{0.1}}, kMaxError);
  std::vector<Eigen::Isometry3d> X_FL = {test::at(0, 0, 0), test::at(0.3, 0, 0), test::at(5, 0, 0)};
  QueryConfig with_margin = config();
  with_margin.margin = 0.02;
  SelfQuery query(model, {{0, 1}, {1, 2}}, with_margin);
  std::vector<PairProximity> results;
  query.run(X_FL, {true, true, true}, &results);
  EXPECT_NEAR(results[0].distance, 0.1, 1e-9);
  EXPECT_NEAR(results[0].lower_bound, 0.08, 1e-9);
  EXPECT_TRUE(results[0].direction.isApprox(-Eigen::Vector3d::UnitX(), 1e-6));
  EXPECT_EQ(results[1].state, LinkState::kClear);
  EXPECT_EQ(results[1].lower_bound, with_margin.max_distance);

  // The distance exceeds max_distance by less than the margin.
  X_FL[1].translation().x() = 0.2 + with_margin.max_distance + 0.01;
  query.run(X_FL, {true, true, true}, &results);
  EXPECT_EQ(results[0].state, LinkState::kNear);
  EXPECT_NEAR(results[0].lower_bound, with_margin.max_distance - 0.01, 1e-5);
  query.set_config(config());
  query.run(X_FL, {true, true, true}, &results);
  EXPECT_EQ(results[0].state, LinkState::kClear);
  EXPECT_EQ(results[0].lower_bound, with_margin.max_distance);

  query.run(X_FL, {true, false, true}, &results);
  for (const PairProximity& result : results) {
    EXPECT_EQ(result.state, LinkState::kUnknown);
    EXPECT_TRUE(std::isnan(result.distance));
    EXPECT_EQ(result.lower_bound, -std::numeric_limits<double>::infinity());
  }
}

// A small box above the face of a large one, packed coarsely, corner down: inner spheres stay away
// from corners by more than a centimetre, so a bound from them would be that much too high. The
// true distance is the height of the lowest corner.
TEST(SelfQuery, CoarsePackingsAreNoLargerThanTheirLinks) {
  test::Rng rng(13);
  const Eigen::Vector3d small(0.2, 0.15, 0.1), large(2.0, 2.0, 0.2);
  const auto model = test::make_model({test::box(small), test::box(large)}, 0.02);
  for (const LinkPair pair : {LinkPair{0, 1}, LinkPair{1, 0}}) {
    SelfQuery query(model, {pair}, {});
    std::vector<PairProximity> results;
    for (int i = 0; i < test::scaled(500); ++i) {
      std::vector<Eigen::Isometry3d> X_FL = {test::random_pose(&rng, 0.2), test::at(0, 0, 0)};
      const double lowest = test::bounds(test::moved(test::box(small), X_FL[0])).min().z() -
                            X_FL[0].translation().z();
      const double truth = test::uniform(&rng, 0.001, 0.3);
      X_FL[0].translation().z() = 0.5 * large.z() + truth - lowest;
      query.run(X_FL, {true, true}, &results);
      ASSERT_LE(results[0].lower_bound, truth + 1e-12) << i;
      ASSERT_GE(results[0].distance, truth - 1e-9) << i;
    }
  }
}

// A pose of NaN was taken for one, and the search for parts that are near ended after minutes.
TEST(SelfQuery, aPoseThatIsNoneMakesItsPairsUnknown) {
  test::Rng rng(13);
  const TriangleMesh lump = test::random_lump(&rng), soup = test::random_soup(&rng, 20);
  const auto model = test::make_model({Box{{0.1, 0.1, 0.1}}, lump, soup}, 0.02);
  SelfQuery query(model, {{0, 1}, {0, 2}, {1, 2}}, config());
  const std::vector<bool> known(3, true);
  std::vector<Eigen::Isometry3d> good(3, Eigen::Isometry3d::Identity());
  good[1].translation().x() = good[2].translation().y() = 0.2;
  std::vector<PairProximity> results;
  query.run(good, known, &results);
  const std::vector<PairProximity> before = results;
  // Of the last two, each is finite and the one in the other's frame is not.
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), 1.5e308}) {
    std::vector<Eigen::Isometry3d> X_FL = good;
    X_FL[0].translation().x() = bad;
    X_FL[1].translation().x() = X_FL[2].translation().x() = std::isfinite(bad) ? -bad : 0.2;
    EXPECT_TRUE(query.run(X_FL, known, &results));
    EXPECT_EQ(results[0].state, LinkState::kUnknown) << bad;
    EXPECT_EQ(results[1].state, LinkState::kUnknown) << bad;
    EXPECT_NE(results[2].state, LinkState::kUnknown) << bad;
    query.run(good, known, &results);
    for (std::size_t i = 0; i < results.size(); ++i) {
      EXPECT_EQ(results[i].state, before[i].state) << bad;
      EXPECT_NEAR(results[i].distance, before[i].distance, 0.002) << bad;
    }
  }
}

TEST(SelfQuery, aCancelledQueryKnowsNothing) {
  const auto model = test::make_model({Box{{0.1, 0.1, 0.1}}, Sphere{0.1}}, 0.02);
  SelfQuery query(model, {{0, 1}}, {}, [] { return true; });
  std::vector<PairProximity> results;
  EXPECT_TRUE(query.run(std::vector<Eigen::Isometry3d>(2, Eigen::Isometry3d::Identity()),
                        {true, true}, &results));
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].state, LinkState::kUnknown);
  EXPECT_FALSE(results[0].decided);
}

}  // namespace
}  // namespace ist
