#include "ist_proximity/proximity/self_query.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

constexpr double kMaxError = 0.005;       // [m]
constexpr std::size_t kClosedLinks = 17;  // of random_links; the others have holes

// Points of a link on its surface, and inside it if it is closed, in the link frame. The inside of
// a mesh with holes holds air, which collides with nothing.
std::vector<Eigen::Vector3d> points_of(const LinkGeometry& link, bool is_closed, test::Rng* rng) {
  std::vector<Eigen::Vector3d> points;
  for (const GeometryElement& element : link) {
    if (const auto* mesh = std::get_if<TriangleMesh>(&element.shape)) {
      for (std::size_t t = 0; t < mesh->triangles.size(); ++t) {
        const double a = test::uniform(rng, 0, 1), b = test::uniform(rng, 0, 1 - a);
        points.push_back(element.X_LE * ((1 - a - b) * mesh->corner(t, 0) + a * mesh->corner(t, 1) +
                                         b * mesh->corner(t, 2)));
      }
      for (const Eigen::Vector3d& v : mesh->vertices) points.push_back(element.X_LE * v);
    }
  }
  for (int i = 0; is_closed && i < test::scaled(600); ++i) {
    const Eigen::Vector3d p = test::random_vector(rng, 0.25);
    if (test::oracle_signed_distance(link, p) <= 0.0) points.push_back(p);
  }
  return points;
}

// The smallest signed distance to B of any point of A that a random search finds. It is an upper
// bound of the true one.
double found_distance(const LinkGeometry& a, const LinkGeometry& b, const Eigen::Isometry3d& X_BA,
                      test::Rng* rng) {
  double best = std::numeric_limits<double>::infinity();
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  const auto attempt = [&](const Eigen::Vector3d& p_A) {
    const double distance = test::oracle_signed_distance(b, X_BA * p_A);
    if (distance >= best) return false;
    best = distance;
    at = p_A;
    return true;
  };
  const bool is_closed = Solid(a).is_closed();
  for (const Eigen::Vector3d& p_A : points_of(a, is_closed, rng)) attempt(p_A);
  double step = 0.05;
  // A random walk within A that keeps what is nearer to B.
  for (int i = 0; is_closed && i < test::scaled(300); ++i) {
    const Eigen::Vector3d p_A = at + test::random_vector(rng, step);
    const bool better = test::oracle_signed_distance(a, p_A) <= 0.0 && attempt(p_A);
    step *= better ? 1.2 : 0.95;
  }
  return best;
}

struct Scene {
  std::vector<LinkGeometry> links;
  std::shared_ptr<const RobotModel> model;
  std::vector<LinkPair> pairs;
  std::vector<Eigen::Isometry3d> X_FL;
};

Scene random_scene(test::Rng* rng, std::size_t count) {
  Scene scene;
  scene.links = test::random_links(rng);
  scene.links.resize(std::min(count, scene.links.size()));
  scene.model = test::model_of(scene.links, kMaxError);
  for (std::size_t i = 0; i < scene.links.size(); ++i) {
    for (std::size_t k = i + 1; k < scene.links.size(); ++k) scene.pairs.push_back({i, k});
  }
  scene.X_FL.resize(scene.links.size());
  return scene;
}

QueryConfig config() {
  QueryConfig result;
  result.max_distance = 0.25;
  return result;
}

// The witnesses are `distance` apart. Apart, they are on the surfaces of their links; in contact,
// one is inside its own link and has this signed distance to the other one.
void check_witnesses(const Scene& scene, const LinkPair& pair, const PairProximity& result) {
  const auto signed_distance = [&](std::size_t link, const Eigen::Vector3d& p_F) {
    return test::oracle_signed_distance(scene.links[link], scene.X_FL[link].inverse() * p_F);
  };
  EXPECT_NEAR(result.direction.norm(), 1.0, 1e-9);
  const Eigen::Vector3d apart = result.p_FCa - result.p_FCb;
  EXPECT_LT((apart - result.distance * result.direction).norm(), 1e-9);
  if (result.state == LinkState::kNear) {
    EXPECT_LT(std::abs(signed_distance(pair.first, result.p_FCa)), 1e-9);
    EXPECT_LT(std::abs(signed_distance(pair.second, result.p_FCb)), 1e-9);
    return;
  }
  const double of_first = signed_distance(pair.second, result.p_FCa);
  const double of_second = signed_distance(pair.first, result.p_FCb);
  const bool first_searched = std::abs(of_first - result.distance) < 1e-7 &&
                              signed_distance(pair.first, result.p_FCa) < 1e-7;
  const bool second_searched = std::abs(of_second - result.distance) < 1e-7 &&
                               signed_distance(pair.second, result.p_FCb) < 1e-7;
  EXPECT_TRUE(first_searched || second_searched)
      << of_first << " " << of_second << " " << result.distance;
}

TEST(SelfQuery, randomLinksAgainstARandomSearch) {
  test::Rng rng(11);
  Scene scene = random_scene(&rng, kClosedLinks);
  SelfQuery query(scene.model, scene.pairs, config());
  std::vector<PairProximity> results;
  int near = 0, contacts = 0, clear = 0;
  for (int trial = 0; trial < 3; ++trial) {
    for (auto& X : scene.X_FL) X = test::random_pose(&rng, 0.22);
    query.run(scene.X_FL, std::vector<bool>(scene.links.size(), true), &results);
    ASSERT_EQ(results.size(), scene.pairs.size());
    for (std::size_t i = 0; i < results.size(); ++i) {
      const auto [first, second] = scene.pairs[i];
      const PairProximity& result = results[i];
      // In contact, the depth depends on the link whose points are taken; the deeper one counts.
      const Eigen::Isometry3d X = scene.X_FL[second].inverse() * scene.X_FL[first];
      const double there = found_distance(scene.links[first], scene.links[second], X, &rng);
      const double back =
          found_distance(scene.links[second], scene.links[first], X.inverse(), &rng);
      const std::string what = "links " + std::to_string(first) + ", " + std::to_string(second);
      if (result.state == LinkState::kClear) {
        ++clear;
        EXPECT_GE(std::min(there, back), 0.25) << what;
        EXPECT_EQ(result.lower_bound, 0.25);
        EXPECT_EQ(result.distance, std::numeric_limits<double>::infinity());
        continue;
      }
      EXPECT_LE(result.lower_bound, std::min(there, back) + 1e-12) << what;
      EXPECT_LE(result.lower_bound, result.distance) << what;
      check_witnesses(scene, scene.pairs[i], result);
      if (result.state == LinkState::kContact) {  // the witnesses prove it
        ++contacts;
        EXPECT_LT(result.distance, 0.0) << what;
        continue;
      }
      ++near;
      EXPECT_EQ(result.state, LinkState::kNear) << what;
      EXPECT_GE(result.distance, 0.0) << what;
      EXPECT_GE(std::min(there, back), 0.0) << what;
      EXPECT_LE(result.distance, result.lower_bound + config().tolerance + 1e-9) << what;
    }
  }
  EXPECT_GT(near, 50);
  EXPECT_GT(contacts, 30);
  EXPECT_GT(clear, 5);
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

TEST(SelfQuery, boundsHoldForLinksWithHoles) {
  test::Rng rng(13);
  Scene scene = random_scene(&rng, 100);
  SelfQuery query(scene.model, scene.pairs, config());
  std::vector<PairProximity> results;
  int apart = 0;
  for (int trial = 0; trial < (test::kSanitized ? 1 : 4); ++trial) {
    for (auto& X : scene.X_FL) X = test::random_pose(&rng, 0.25);
    query.run(scene.X_FL, std::vector<bool>(scene.links.size(), true), &results);
    for (std::size_t i = 0; i < results.size(); ++i) {
      const auto [first, second] = scene.pairs[i];
      if (second < kClosedLinks || results[i].state == LinkState::kClear) continue;
      const Eigen::Isometry3d X = scene.X_FL[second].inverse() * scene.X_FL[first];
      const double there = found_distance(scene.links[first], scene.links[second], X, &rng);
      const double back =
          found_distance(scene.links[second], scene.links[first], X.inverse(), &rng);
      EXPECT_LE(results[i].lower_bound, std::min(there, back) + 1e-12) << first << ", " << second;
      apart += results[i].lower_bound > 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(apart, 10) << "the bounds must separate some links";
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
  std::vector<Eigen::Isometry3d> X_FL(3, Eigen::Isometry3d::Identity());
  X_FL[1].translation().x() = 0.3;
  X_FL[2].translation().x() = 5.0;
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
  QueryConfig config;
  config.max_distance = 1.0;
  for (const bool swapped : {false, true}) {
    const LinkPair pair = swapped ? LinkPair{1, 0} : LinkPair{0, 1};
    SelfQuery query(model, {pair}, config);
    std::vector<PairProximity> results;
    for (int i = 0; i < test::scaled(500); ++i) {
      std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
      X_FL[0] = test::random_pose(&rng, 0.2);
      double lowest = std::numeric_limits<double>::infinity();
      for (const double x : {-0.5, 0.5}) {
        for (const double y : {-0.5, 0.5}) {
          for (const double z : {-0.5, 0.5}) {
            const Eigen::Vector3d corner(x * small.x(), y * small.y(), z * small.z());
            lowest = std::min(lowest, (X_FL[0].linear() * corner).z());
          }
        }
      }
      const double truth = test::uniform(&rng, 0.001, 0.3);
      X_FL[0].translation().z() = 0.5 * large.z() + truth - lowest;
      query.run(X_FL, {true, true}, &results);
      ASSERT_LE(results[0].lower_bound, truth + 1e-12) << i;
      ASSERT_GE(results[0].distance, truth - 1e-9) << i;
    }
  }
}

}  // namespace
}  // namespace ist
