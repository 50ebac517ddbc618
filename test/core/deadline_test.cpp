// What ends when time does: queries, repulsion and contact volumes; what they say is left.

#include <gtest/gtest.h>

#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>
#include <vector>

#include "internal/proximity/deadline.h"
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "support/box_oracle.h"
#include "support/contact_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

using test::ContactLink;
using test::one;
using Points = std::vector<Eigen::Vector3d>;
using Clock = std::chrono::steady_clock;

// [s] A step between two looks at the clock takes less, nine times in ten; instrumented code is
// slower.
constexpr double kStep = test::kSanitized ? 5e-3 : 0.1e-3;

TimePoint from_now(double seconds) {
  return Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

// [s] Processor time of this thread: other processes do not count.
double thread_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<std::size_t>(q * static_cast<double>(values.size()));
  return values[std::min(rank, values.size() - 1)];
}

Points shell(std::size_t count, double radius) {
  test::Rng rng(5);
  Points points;
  for (std::size_t i = 0; i < count; ++i) {
    points.push_back(radius * test::random_vector(&rng, 1.0).normalized());
  }
  return points;
}

// Thinned points all over a cube.
CloudSnapshot cube(double half, double spacing) {
  Points points;
  for (double x = -half; x <= half; x += spacing) {
    for (double y = -half; y <= half; y += spacing) {
      for (double z = -half; z <= half; z += spacing) points.emplace_back(x, y, z);
    }
  }
  return test::thinned(points, spacing);
}

// A volume that time ends is a lower bound, says how much it is of, and makes no wrench: of a
// cloud, of one leaf of a map that is divided into thousands of cells, and of two links.
TEST(Deadline, EndsAContactVolume) {
  const ContactLink link(one(Box{{0.4, 0.4, 0.4}})), mesh(one(test::icosphere(0.2, 5)));
  const CloudSnapshot cloud = cube(0.19, 0.01);
  const CloudSnapshot map =
      test::make_map({{Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1)}});
  const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  const Eigen::Isometry3d X(Eigen::Translation3d(0.2, 0.1, 0.05));
  const std::function<ContactVolume(TimePoint)> volumes[] = {
      [&](TimePoint end) { return contact_volume(link.link(), *link.body, X_FL, {&cloud}, end); },
      [&](TimePoint end) { return contact_volume(link.link(), *link.body, X_FL, {&map}, end); },
      [&](TimePoint end) { return contact_volume(*link.body, *mesh.body, X, end); }};
  for (const auto& volume : volumes) {
    const ContactVolume whole = volume(from_now(1e3));
    ASSERT_EQ(whole.known, 1.0);
    ASSERT_GT(whole.volume, 0.0);
    const ContactVolume none = volume(Clock::now());
    EXPECT_LT(none.known, 1.0);
    EXPECT_LE(none.volume, whole.volume);
    std::vector<double> overruns;
    for (int i = 0; i < test::scaled(100); ++i) {
      const double limit = 2e-5 * (1 + i % 5);
      const double begin = thread_time();
      const ContactVolume part = volume(from_now(limit));
      overruns.push_back(thread_time() - begin - limit);
      ASSERT_LT(part.known, 1.0);
      ASSERT_LE(part.volume, whole.volume);
      LinkProximity contact;
      contact.state = LinkState::kContact;
      contact.lower_bound = contact.distance = -0.1;
      ASSERT_TRUE(std::isnan(penetration_wrench(contact, {}, &part, X_FL, {}).force.x()));
    }
    EXPECT_LT(quantile(overruns, 0.9), kStep);
  }
}

// Repulsion that is not there in time is NaN, never that of some of the points.
TEST(Deadline, EndsRepulsion) {
  const auto model = test::make_model({Box{{0.4, 0.4, 0.4}}}, 0.01);
  const Repulsion repulsion(model);
  RepulsionConfig config;
  config.smoothing = 1.0;  // every pair counts
  const CloudSnapshot cloud = cube(0.6, 0.03);
  LinkProximity near;
  near.state = LinkState::kNear;
  near.distance = near.lower_bound = 0.05;
  near.direction = Eigen::Vector3d::UnitX();
  const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  const RepulsiveWrench whole = repulsion.wrench(0, X_FL, {&cloud}, near, config);
  ASSERT_TRUE(whole.force.allFinite());
  std::vector<double> overruns;
  int known = 0, unknown = 0;
  for (int i = 0; i < test::scaled(400); ++i) {
    const double limit = i % 2 == 0 ? 1e-5 * (1 + i % 40) : 10.0;
    const double begin = thread_time();
    const RepulsiveWrench found =
        repulsion.wrench(0, X_FL, {&cloud}, near, config, from_now(limit));
    overruns.push_back(thread_time() - begin - limit);
    if (std::isnan(found.force.x())) {
      ++unknown;
      EXPECT_TRUE(found.force.array().isNaN().all() && found.torque.array().isNaN().all());
    } else {
      ++known;
      EXPECT_EQ(found.force, whole.force);
      EXPECT_EQ(found.torque, whole.torque);
    }
  }
  EXPECT_GT(known, 0);
  EXPECT_GT(unknown, 0);
  EXPECT_LT(quantile(overruns, 0.9), kStep);
  // A link that is not repelled needs no time.
  near.distance = 10.0;
  EXPECT_TRUE(repulsion.wrench(0, X_FL, {&cloud}, near, config, Clock::now()).force.isZero(0.0));
}

// The first upper bounds of many links count as well: each is an exact distance.
TEST(Deadline, HoldsForManyLinksAndANewCloud) {
  const std::vector<Shape> shapes(test::scaled(40), Shape(test::torus(0.1, 0.03, 48, 24)));
  const auto model = test::make_model(shapes, 0.01);
  test::Rng rng(9);
  std::vector<Eigen::Isometry3d> X_FL;
  for (std::size_t i = 0; i < shapes.size(); ++i) X_FL.push_back(test::random_pose(&rng, 0.3));
  const std::vector<bool> known(shapes.size(), true);
  QueryConfig config;
  config.deadline = 5e-5;
  std::vector<LinkProximity> results;
  std::vector<double> overruns;
  ProximityQuery query(model, config), whole(model, {});
  std::vector<double> whole_times;
  for (int i = 0; i < test::scaled(100); ++i) {
    const CloudSnapshot cloud = test::make_snapshot(shell(5000, 0.8));
    const double start = thread_time();
    whole.run(X_FL, known, {&cloud}, &results);
    whole_times.push_back(thread_time() - start);
    const double begin = thread_time();
    query.run(X_FL, known, {&cloud}, &results);
    overruns.push_back(thread_time() - begin - config.deadline);
    for (std::size_t k = 0; k < results.size(); ++k) {
      if (results[k].state == LinkState::kUnknown) continue;
      ASSERT_LE(results[k].lower_bound, results[k].distance);
    }
  }
  EXPECT_LT(quantile(overruns, 0.9), 0.25 * quantile(whole_times, 0.5));
}

// A link that has jumped out of reach of its last obstacle gets another one, even without time: it
// stayed UNKNOWN as long as there was none.
TEST(Deadline, FindsAnObstacleAfterAJump) {
  const auto model = test::make_model({Shape(test::torus(0.1, 0.03, 48, 24))}, 0.01);
  Points points = shell(300, 0.2);
  for (const Eigen::Vector3d& p : shell(300, 0.2))
    points.emplace_back(p + Eigen::Vector3d(4, 0, 0));
  const CloudSnapshot cloud = test::make_snapshot(points);
  QueryConfig config;
  config.deadline = 1.0;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  query.run({Eigen::Isometry3d::Identity()}, {true}, {&cloud}, &results);
  for (const double x : {4.0, 0.0}) {
    const Eigen::Isometry3d X_FL(Eigen::Translation3d(x, 0.01, 0.02));
    Deadline::asks_left_for_test = 0;
    query.run({X_FL}, {true}, {&cloud}, &results);
    Deadline::asks_left_for_test = -1;
    const LinkProximity& result = results[0];
    ASSERT_EQ(result.state, LinkState::kNear) << x;
    const double distance =
        model->links[0].solid.signed_distance(X_FL.inverse() * result.p_FCo).distance;
    EXPECT_NEAR(result.distance, distance, 1e-6);
    EXPECT_LE(result.lower_bound, result.distance);
  }
}

// In contact with a fine mesh, with holes or without, queries are late by about the time of one
// exact distance: nothing is gained where a link is known not to be free.
TEST(Deadline, IsAskedBeforeEachDistanceInContact) {
  TriangleMesh open = test::icosphere(0.1, 6);
  open.triangles.resize(open.triangles.size() - 40);
  const auto model =
      test::make_model({Shape(test::icosphere(0.1, 6)), Shape(std::move(open))}, 0.005);
  test::Rng rng(10);
  Points points;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3d direction = test::random_vector(&rng, 1.0).normalized();
    points.push_back(test::uniform(&rng, 0.097, 0.103) * direction);
  }
  const CloudSnapshot cloud = test::make_snapshot(points);
  QueryConfig config;
  for (const bool is_open : {false, true}) {
    const double start = thread_time();
    for (const Eigen::Vector3d& p : points) {
      ASSERT_LT(model->links[is_open ? 1 : 0].solid.signed_distance(p).distance, 0.02);
    }
    const double exact = (thread_time() - start) / static_cast<double>(points.size());
    std::vector<double> overruns;
    std::vector<LinkProximity> results;
    for (int i = 0; i < test::scaled(100); ++i) {
      ProximityQuery query(model, config);
      config.deadline = 2e-5 + 1e-5 * i;
      query.set_config(config);
      const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.0);
      const double begin = thread_time();
      query.run({X_FL, X_FL}, {!is_open, is_open}, {&cloud}, &results);
      overruns.push_back(thread_time() - begin - config.deadline);
      ASSERT_LE(results[is_open ? 1 : 0].lower_bound, -0.002);
    }
    // The factor is of steps that sanitizers slow down unevenly.
    if (!test::kSanitized) EXPECT_LT(quantile(overruns, 0.5), 4.0 * exact) << is_open;
  }
}

// A link counts as unfinished where its bounds are wider than was asked for, and nowhere else.
TEST(Deadline, SaysHowManyLinksItLeft) {
  const auto model = test::make_model({Sphere{0.1}, Sphere{0.1}, Sphere{0.1}}, 0.005);
  std::vector<Eigen::Isometry3d> X_FL(3, Eigen::Isometry3d::Identity());
  X_FL[1].translation().x() = 2.0;
  X_FL[2].translation().x() = 50.0;  // CLEAR
  const CloudSnapshot cloud = test::make_snapshot(shell(50000, 0.4));
  QueryConfig config;
  config.tolerance = 0.0;
  std::vector<LinkProximity> results;
  std::size_t some = 0;
  for (int i = 0; i < test::scaled(200); ++i) {
    config.deadline = 1e-6 * std::pow(10.0, 0.02 * (i % 150));
    ProximityQuery query(model, config);
    const bool complete = query.run(X_FL, {true, true, true}, {&cloud}, &results);
    std::size_t wide = 0;
    double widest = 0.0;
    for (const LinkProximity& one : results) {
      if (one.state == LinkState::kClear) continue;
      const double width = one.distance - one.lower_bound;
      if (width <= 2e-6) continue;
      ++wide;
      if (!std::isnan(width)) widest = std::max(widest, width);
    }
    ASSERT_EQ(query.statistics().unfinished, wide);
    ASSERT_EQ(query.statistics().widest, widest);
    if (complete) ASSERT_EQ(wide, 0U);
    some += wide;
  }
  EXPECT_GT(some, 0U);
  config.deadline = 0.0;
  ProximityQuery query(model, config);
  query.run(X_FL, {true, true, true}, {&cloud}, &results);
  EXPECT_EQ(query.statistics().unfinished, 0U);
}

// A query that has a deadline asks coarsely first. Where the deadline passes then, the coarse
// answer is kept, and the same pose asked again must not take it for the whole one: it said to be
// complete with bounds half as wide as the distance.
TEST(Deadline, DoesNotMakeACoarseAnswerAWholeOne) {
  const auto model = test::make_model({Sphere{0.1}}, 0.005);
  const CloudSnapshot cloud = test::make_snapshot(shell(20000, 0.4));
  QueryConfig config;
  config.tolerance = 0.0;
  std::vector<LinkProximity> results;
  int late = 0;
  for (int i = 0; i < test::scaled(300); ++i) {
    ProximityQuery query(model, config);
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation().x() = 1e-4 * i;
    for (const double deadline : {1e-6 * std::pow(10.0, 0.01 * i), 100.0}) {
      config.deadline = deadline;
      query.set_config(config);
      const bool complete = query.run({X_FL}, {true}, {&cloud}, &results);
      late += complete ? 0 : 1;
      if (!complete) continue;
      ASSERT_EQ(results[0].state, LinkState::kNear);
      ASSERT_LT(results[0].distance - results[0].lower_bound, 2e-6) << i << ", " << deadline;
    }
  }
  EXPECT_GT(late, 0);
}

// Five million points, all at one place or all equally near: answered in time, with bounds that
// hold, from the first query on.
TEST(Deadline, HoldsForFiveMillionPointsThatAreEquallyNear) {
  const std::size_t count = test::kSanitized ? 100000 : 5000000;
  const auto model = test::make_model({Sphere{0.1}, Box{{0.1, 0.2, 0.3}}}, 0.005);
  const Points same(count, Eigen::Vector3d(0.4, 0.0, 0.0));
  for (const bool at_one_place : {true, false}) {
    const CloudSnapshot cloud = test::make_snapshot(at_one_place ? same : shell(count, 0.4));
    for (const double deadline : {1e-3, 5e-3}) {
      QueryConfig config;
      config.deadline = (test::kSanitized ? 20.0 : 1.0) * deadline;
      ProximityQuery query(model, config);
      std::vector<LinkProximity> results;
      std::vector<double> overruns;
      Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      for (int step = 0; step < 100; ++step) {
        X_FL.translation().z() = 1e-4 * step;
        const double begin = thread_time();
        query.run({X_FL, X_FL}, {true, true}, {&cloud}, &results);
        overruns.push_back(thread_time() - begin - config.deadline);
        const double from_center = at_one_place ? std::hypot(0.4, 1e-4 * step) : 0.4 - 1e-4 * step;
        ASSERT_EQ(results[0].state, LinkState::kNear);
        ASSERT_LE(results[0].lower_bound, from_center - 0.1 + 1e-6);
        ASSERT_GE(results[0].distance, from_center - 0.1 - 1e-6);
        ASSERT_GT(results[0].lower_bound, 0.0);
        ASSERT_GT(results[1].lower_bound, 0.0);
      }
      EXPECT_LT(quantile(overruns, 0.9), kStep) << at_one_place << ", " << deadline << " s";
    }
  }
}

}  // namespace
}  // namespace ist
