// Link against link where it is hard to tell whether they touch: less than nanometres apart, and
// next to the opening of a mesh.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "internal/geometry/convex_part.h"
#include "ist_proximity/proximity/self_query.h"
#include "support/broken_promise.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;

/// Two links and their poses.
struct Pair {
  Pair(const Shape& first, const Shape& second, double max_error = 0.02)
      : links{test::one(first), test::one(second)}, model(test::model_of(links, max_error)) {}

  PairProximity run(SelfQuery* query) const {
    std::vector<PairProximity> results;
    query->run(X_FL, {true, true}, &results);
    return results[0];
  }
  PairProximity run_fresh() const {
    SelfQuery query = make_query();
    return run(&query);
  }
  SelfQuery make_query() const {
    QueryConfig config;
    config.tolerance = 0.0;
    return {model, {{0, 1}}, config};
  }
  /// Moves the first link along the shortest line until the distance is this one.
  void approach(double distance) {
    for (int i = 0; i < 3; ++i) {
      const PairProximity now = run_fresh();
      ASSERT_EQ(now.state, LinkState::kNear);
      X_FL[0].translation() -= (now.distance - distance) * now.direction;
    }
  }

  std::vector<LinkGeometry> links;
  std::shared_ptr<const RobotModel> model;
  Poses X_FL = Poses(2, Eigen::Isometry3d::Identity());
};

// The line through the closest points is known to rounding over distance: at 0.1 nm that turns a
// slab of 0.1 m by 10 um, and proves nothing. The triangles' own axes do.
TEST(PairTouch, TrianglesTenthsOfANanometreApartAreProvenApart) {
  test::Rng rng(151);
  int cases = 0, proven = 0;
  for (int i = 0; i < 20000; ++i) {
    const auto corner = [&] { return test::random_vector(&rng, 0.1); };
    ConvexPart p, q;
    p.a = corner(), p.b = corner(), p.c = corner();
    q.a = corner(), q.b = corner(), q.c = corner();
    const ConvexDistance before = triangle_distance(p, q);
    if (!(before.distance > 1e-3)) continue;
    const double distance = test::power_of_ten(&rng, -10.0, -7.0);
    const Eigen::Vector3d n = (before.on_p - before.on_q) / before.distance;
    const Eigen::Vector3d shift = (before.distance - distance) * n;
    for (Eigen::Vector3d* corner_p : {&p.a, &p.b, &p.c}) *corner_p -= shift;
    const ConvexDistance found = triangle_distance(p, q);
    ASSERT_NEAR(found.distance, distance, 1e-14) << i;
    ASSERT_LE(found.lower_bound, found.distance) << i;
    ++cases;
    proven += found.lower_bound > 0.1 * distance ? 1 : 0;
  }
  EXPECT_GT(cases, 5000);
  EXPECT_GT(proven, cases - cases / 100);
}

// A bound of minus 25 mm at 0.2 nm was what a box has at most as its depth.
TEST(PairTouch, FreshAndKeptSearchesAgreeNextToTouch) {
  test::Rng rng(152);
  for (int i = 0; i < 40; ++i) {
    Pair pair(test::l_shape(0.2, 0.04), test::random_lump(&rng));
    pair.X_FL[0] = test::random_pose(&rng, 0.3);
    pair.X_FL[1] = pair.X_FL[0];
    pair.X_FL[1].translation() += 0.5 * test::random_vector(&rng, 1.0).normalized();
    pair.X_FL[1].linear() = test::random_pose(&rng, 0.0).linear();
    SelfQuery kept = pair.make_query();
    for (const double distance : {1e-3, 1e-7, 1e-9, 3e-10}) {
      ASSERT_NO_FATAL_FAILURE(pair.approach(distance));
      const PairProximity warm = pair.run(&kept), fresh = pair.run_fresh();
      for (const PairProximity& answer : {warm, fresh}) {
        EXPECT_EQ(answer.state, LinkState::kNear) << i << " at " << distance;
        EXPECT_TRUE(answer.decided);
        EXPECT_NEAR(answer.distance, distance, 1e-12);
        EXPECT_GT(answer.lower_bound, distance > 1e-8 ? 0.99 * distance : 0.0)
            << i << " at " << distance;
        EXPECT_LE(answer.lower_bound, answer.distance);
      }
    }
  }
}

// The distance of closed links changes no faster than they move, so a kept bound loses the motion
// when they touch, and not all that their spheres leave open.
TEST(PairTouch, AKeptBoundLosesNoMoreThanTheMotionWhenLinksTouch) {
  test::Rng rng(153);
  for (int i = 0; i < 20; ++i) {
    Pair pair(test::box({0.2, 0.1, 0.05}), test::random_lump(&rng));
    pair.X_FL[1].translation() = 0.5 * test::random_vector(&rng, 1.0).normalized();
    ASSERT_NO_FATAL_FAILURE(pair.approach(1e-6));
    SelfQuery kept = pair.make_query();
    const PairProximity before = pair.run(&kept);
    ASSERT_GT(before.lower_bound, 0.0);
    double moved = 0.0;
    for (int step = 0; step < 5; ++step) {
      constexpr double kStep = 1e-5;  // [m]
      pair.X_FL[0].translation() -= kStep * before.direction;
      moved += kStep;
      const PairProximity after = pair.run(&kept);
      ASSERT_EQ(after.state, LinkState::kContact) << i;
      EXPECT_TRUE(after.decided);
      EXPECT_GE(after.lower_bound, before.lower_bound - moved - 1e-9) << i;
      EXPECT_LE(after.lower_bound, after.distance);
      for (const Eigen::Vector3d& p : std::get<TriangleMesh>(pair.links[1][0].shape).vertices) {
        const Eigen::Vector3d p_A = pair.X_FL[0].inverse() * (pair.X_FL[1] * p);
        EXPECT_LE(after.lower_bound, test::oracle_signed_distance(pair.links[0], p_A) + 1e-12);
      }
    }
  }
}

// Bounds of minus 49 to 64 mm were what spheres leave open where solids overlap by nanometres.
TEST(PairTouch, TheBoundIsTheGapAtTouchAndTheDepthInside) {
  const Eigen::Vector3d size(0.2, 0.2, 0.2);
  const Eigen::Isometry3d flat = Eigen::Isometry3d::Identity();
  const double turn = 0.25 * EIGEN_PI, edge = 0.1 * std::sqrt(2.0);  // [m] an edge's height
  const Eigen::Isometry3d about_y(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
  const Eigen::Isometry3d about_z(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
  struct Case {
    const char* name;
    Shape a, b;
    Eigen::Isometry3d X_a, X_b;
    double apart;  // [m] along x, at touch
  };
  const Case cases[] = {{"box, box", Box{size}, Box{size}, flat, flat, 0.2},
                        {"box, cylinder", Box{size}, Cylinder{0.1, 0.2}, flat, flat, 0.2},
                        {"box, sphere", Box{size}, Sphere{0.1}, flat, flat, 0.2},
                        {"cylinders", Cylinder{0.1, 0.2}, Cylinder{0.1, 0.2}, flat, flat, 0.2},
                        {"spheres", Sphere{0.1}, Sphere{0.1}, flat, flat, 0.2},
                        {"mesh, box", test::box(size), Box{size}, flat, flat, 0.2},
                        {"meshes", test::box(size), test::box(size), flat, flat, 0.2},
                        {"edge, edge", test::box(size), Box{size}, about_y, about_z, 2.0 * edge}};
  for (const Case& one : cases) {
    Pair pair(one.a, one.b);
    for (const double gap : {-1e-4, -1e-6, -1e-9, 0.0, 1e-12, 1e-9, 1e-7, 1e-4}) {
      pair.X_FL = {one.X_a, Eigen::Translation3d(one.apart + gap, 0.0, 0.0) * one.X_b};
      const PairProximity answer = pair.run_fresh();
      SCOPED_TRACE(testing::Message() << one.name << ", gap " << gap);
      EXPECT_LE(answer.lower_bound, std::max(gap, 0.0) + 1e-14);
      EXPECT_GE(answer.lower_bound, gap - 1e-9);
    }
  }
}

// Only the cover of a sphere reaches into a corner, and its middle may be outside the other link.
TEST(PairTouch, ACornerIsAsDeepAsItIs) {
  const Eigen::Matrix3d corner_up =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(1.0, 1.0, 1.0), Eigen::Vector3d::UnitX())
          .toRotationMatrix();
  const double corner = 0.1 * std::sqrt(3.0);  // [m] its height
  for (const double max_error : {0.02, 0.005}) {
    Pair pair(test::box({0.2, 0.2, 0.2}), Sphere{0.3}, max_error);
    pair.X_FL[0].linear() = corner_up;
    for (double depth = 1e-4; depth < 0.05; depth *= 1.3) {
      pair.X_FL[1].translation() = Eigen::Vector3d(0.3 + corner - depth, 0.0, 0.0);
      const PairProximity answer = pair.run_fresh();
      EXPECT_EQ(answer.state, LinkState::kContact) << depth;
      EXPECT_LE(answer.lower_bound, -depth + 1e-12) << max_error;
      EXPECT_GE(answer.distance, answer.lower_bound);
    }
  }
}

// The tip of a needle is inside a box without a lid, 50 mm from all of its walls: spheres of 20 mm
// do not show it, and there is no place where surfaces touch.
TEST(PairTouch, AContactThroughAnOpeningHasADepthAndPointsOnTheLinks) {
  int contacts = 0;
  for (const double depth : {0.001, 0.005, 0.02}) {
    Pair pair(test::open_box({0.1, 0.1, 0.1}), test::needle(0.3, 0.005));
    pair.X_FL[1].linear() = Eigen::AngleAxisd(EIGEN_PI, Eigen::Vector3d::UnitX()).matrix();
    pair.X_FL[1].translation() = Eigen::Vector3d(0.0, 0.0, 0.05 - depth);
    const double truth = test::oracle_signed_distance(pair.links[0], pair.X_FL[1].translation());
    const PairProximity answer = pair.run_fresh();
    SCOPED_TRACE("depth " + std::to_string(depth) + ", truth " + std::to_string(truth));
    if (!(truth < 0.0)) continue;
    ++contacts;
    EXPECT_EQ(answer.state, LinkState::kContact);
    EXPECT_TRUE(answer.decided);
    EXPECT_LT(answer.distance, -0.01);
    EXPECT_LE(answer.lower_bound, truth);
    EXPECT_NEAR((answer.p_FCa - answer.p_FCb).norm(), -answer.distance, 1e-9);
    EXPECT_NEAR(std::abs(test::oracle_signed_distance(pair.links[0], answer.p_FCa)), 0.0, 1e-9);
  }
  EXPECT_GT(contacts, 0);
}

// A lid rests on the rim of a box without one, and a knob on its underside is half a millimetre
// below the rim: it is in a slab of that width, and 50 mm from all walls.
TEST(PairTouch, AKnobInAnOpeningIsAsDeepAsTheWallsAreFar) {
  Pair pair(test::open_box({0.1, 0.1, 0.1}),
            test::joined(test::moved(test::box({0.2, 0.2, 0.02}), test::at(0.0, 0.0, 0.01)),
                         test::box({0.002, 0.002, 0.001})));
  for (const double pressed : {0.0, 1e-9, 1e-6, 1e-4}) {
    pair.X_FL[1] = test::at(0.0, 0.0, 0.05 - pressed);
    const Eigen::Vector3d knob = pair.X_FL[1] * Eigen::Vector3d(0.0, 0.0, -0.0005);
    const double truth = test::oracle_signed_distance(pair.links[0], knob);
    ASSERT_LT(truth, -0.04);
    EXPECT_LE(pair.run_fresh().lower_bound, truth) << pressed;
  }
}

// Next to a floor of two triangles the winding number is a half, less what the floor's edges leave:
// bounds were metres too low.
TEST(PairTouch, AFloorOfTwoTrianglesTakesNothingFromTheBound) {
  for (const double side : {4.0, 50.0}) {
    Pair pair(test::box({0.1, 0.2, 0.3}), test::sheet(side));
    for (const double distance : {-0.5, -0.2, -0.03, 0.03, 0.2, 0.5}) {
      const double half = std::copysign(0.15, distance);
      pair.X_FL[0] = test::at(0.1 * side, -0.2 * side, distance + half);
      const PairProximity result = pair.run_fresh();
      EXPECT_EQ(result.state, LinkState::kNear) << side << " " << distance;
      EXPECT_NEAR(result.lower_bound, std::abs(distance), 1e-6) << side << " " << distance;
    }
  }
}

// Behind a sheet the winding number is a half, so nobody can tell the side. The spheres bound the
// distance all the same; minus 0.33 m was what a link of this size has at most as its depth.
TEST(PairTouch, AnUndecidedOpeningHasTheBoundOfTheSpheres) {
  Pair pair(test::sheet(0.2), Sphere{0.02}, 0.005);
  int undecided = 0;
  for (const double height : {-0.03, -0.025, -0.0225, 0.0225, 0.025, 0.03}) {
    pair.X_FL[1].translation() = Eigen::Vector3d(0.0, 0.0, height);
    const PairProximity answer = pair.run_fresh();
    EXPECT_EQ(answer.state, LinkState::kNear) << height;
    EXPECT_TRUE(answer.finished);
    EXPECT_NEAR(answer.distance, std::abs(height) - 0.02, 1e-9);
    EXPECT_LE(answer.lower_bound, answer.distance);
    EXPECT_GT(answer.lower_bound, -0.1) << height;
    EXPECT_EQ(answer.decided, answer.lower_bound > 0.0) << height;
    undecided += answer.decided ? 0 : 1;
  }
  EXPECT_GT(undecided, 0);
}

// Sequences of queries of link against link that change poses, settings and deadlines in between.
// Bounds hold at every answer, against brute force in double.

QueryConfig random_config(test::Rng* rng) {
  constexpr double kTolerances[] = {0.0, 0.0, 0.0, 1e-5, 0.001, 0.01};
  QueryConfig config;
  config.tolerance = kTolerances[test::below(rng, 6)];
  config.max_distance = test::power_of_ten(rng, -2.0, 1.0);
  config.margin = test::chance(rng, 0.7) ? 0.0 : test::uniform(rng, 0.0, 0.05);
  config.relative_tolerance = test::chance(rng, 0.7) ? 0.0 : test::uniform(rng, 0.0, 1.0);
  if (test::chance(rng, 0.3))
    config.deadline = test::chance(rng, 0.3) ? 1e-12 : test::power_of_ten(rng, -6.5, -4.0);
  return config;
}

TEST(HostilePairs, BoundsHold) {
  test::Rng rng(2212);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.02);
  const std::vector<test::PairBody> bodies(links.begin(), links.end());
  const auto is_closed = [&](std::size_t i) { return model->links[i].solid.is_closed(); };
  const std::vector<bool> known(links.size(), true);
  const int sequences = test::scaled(400);
  int answers = 0, contacts = 0, stopped = 0;
  for (int i = 0; i < sequences && !testing::Test::HasFailure(); ++i) {
    const std::size_t a = test::below(&rng, links.size());
    const std::size_t b = (a + 1 + test::below(&rng, links.size() - 1)) % links.size();
    SCOPED_TRACE("sequence " + std::to_string(i) + ", links " + std::to_string(a) + ", " +
                 std::to_string(b));
    std::vector<Eigen::Isometry3d> X_FL(links.size(), test::random_pose(&rng, 1.0));
    X_FL[b].translation() += test::random_vector(&rng, 0.2);
    X_FL[b].linear() = test::random_pose(&rng, 0.0).linear();
    QueryConfig config = random_config(&rng);
    SelfQuery query(model, {{a, b}}, config);
    for (int step = 0; step < 20 && !testing::Test::HasFailure(); ++step) {
      if (test::chance(&rng, 0.3)) query.set_config(config = random_config(&rng));
      Eigen::Isometry3d& X = X_FL[test::chance(&rng, 0.5) ? a : b];
      if (test::chance(&rng, 0.7)) X = X * test::small_motion(&rng, -1.3);
      if (test::chance(&rng, 0.05)) X = X * test::random_pose(&rng, 0.2);
      std::vector<PairProximity> found;
      const bool is_complete = query.run(X_FL, known, &found);
      test::PairTruth truth = test::pair_truth(bodies[a], bodies[b], X_FL[a].inverse() * X_FL[b],
                                               is_closed(a) && is_closed(b));
      truth.scale = 1.0 + X_FL[a].translation().norm() + X_FL[b].translation().norm();
      EXPECT_EQ(test::broken_promise(found[0], truth, config, is_complete), "") << "step " << step;
      ++answers;
      contacts += found[0].state == LinkState::kContact ? 1 : 0;
      stopped += is_complete ? 0 : 1;
    }
  }
  if (testing::Test::HasFailure()) return;
  EXPECT_GT(contacts, answers / 20);
  EXPECT_GT(stopped, answers / 100);
}

}  // namespace
}  // namespace ist
