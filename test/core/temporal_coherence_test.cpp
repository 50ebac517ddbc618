// Temporal coherence: queries that use bounds proven at earlier poses, on long motions against
// brute force.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "support/box_oracle.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
using Points = std::vector<Eigen::Vector3d>;
using Poses = std::vector<Eigen::Isometry3d>;

const std::vector<Shape>& shapes() {
  static const std::vector<Shape> kShapes = {
      Box{{0.2, 0.1, 0.3}}, Cylinder{0.05, 0.25}, test::l_shape(0.2, 0.05),
      test::torus(0.1, 0.03, 12, 6), test::open_box({0.15, 0.1, 0.2})};
  return kShapes;
}

const test::Trial& links() {
  static const test::Trial trial(shapes(), 0.005);
  return trial;
}

Points random_points(test::Rng* rng, int count, double size) {
  Points points;
  for (int i = 0; i < count; ++i) points.push_back(test::random_vector(rng, size));
  return points;
}

// Rotates a pose about a point by an angle, and translates it.
Eigen::Isometry3d displaced(const Eigen::Isometry3d& X, const Eigen::Vector3d& center, double angle,
                            const Eigen::Vector3d& axis, const Eigen::Vector3d& translation) {
  Eigen::Isometry3d result = Eigen::Translation3d(center + translation) *
                             Eigen::AngleAxisd(angle, axis) * Eigen::Translation3d(-center) * X;
  result.linear() = Eigen::Quaterniond(result.linear()).normalized().toRotationMatrix();
  return result;
}

// A motion of all links, and the cloud of each step.
struct Motion {
  explicit Motion(std::uint64_t seed) : rng(seed), X_FL(shapes().size()) {
    jump();
    change_cloud();
  }

  void jump() {
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.4);
  }

  void change_cloud() {
    points = random_points(&rng, 30, 0.6);
    cloud = test::make_snapshot(points);
  }

  // Links stand still, move a little or turn about a far point. Few steps jump or change the cloud.
  void step() {
    const double kind = test::uniform(&rng, 0.0, 1.0);
    if (kind < 0.01) return jump();
    if (kind < 0.03) return change_cloud();
    if (kind < 0.06) speed = std::pow(10.0, test::uniform(&rng, -6, -2));
    if (kind < 0.09) {
      center = test::random_vector(&rng, kind < 0.075 ? 10.0 : 0.3);
      axis = test::random_vector(&rng, 1.0).normalized();
      direction = test::random_vector(&rng, 1.0);
    }
    if (kind > 0.9) return;
    const double angle = speed / (0.3 + center.norm());
    for (std::size_t i = 1; i < X_FL.size(); ++i) {  // the first one only jumps
      X_FL[i] = displaced(X_FL[i], center, angle, axis, i % 2 * speed * direction);
    }
  }

  test::Rng rng;
  Poses X_FL;
  Points points;
  CloudSnapshot cloud;
  double speed = 1e-3;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), axis = Eigen::Vector3d::UnitZ(),
                  direction = Eigen::Vector3d::UnitX();
};

void expect_minimum(const RobotProximity& robot, const std::vector<test::Truth>& truth,
                    const Motion& motion, const QueryConfig& config) {
  test::Truth least{kInfinity, kInfinity};
  for (const test::Truth& one : truth) {
    least = {std::min(least.measured, one.measured), std::min(least.stored, one.stored)};
  }
  const auto i = static_cast<std::size_t>(std::max(robot.link, 0));
  test::expect_truth(robot.nearest, least, config, motion.X_FL[i]);
}

class CoherentQueries : public ::testing::TestWithParam<double> {};

// All kinds of queries in turn, of one query object.
TEST_P(CoherentQueries, BoundsHoldOnLongMotions) {
  Motion motion(static_cast<std::uint64_t>(62 + 1e4 * GetParam()));
  QueryConfig config;
  config.tolerance = GetParam();
  config.max_distance = 0.5;
  ProximityQuery query(links().shared_model(), config);
  const std::size_t count = motion.X_FL.size();
  const std::vector<bool> known(count, true);
  std::vector<LinkProximity> results;
  RobotProximity robot;
  int contact = 0, steps = test::scaled(1200);
  for (int step = 0; step < steps && !::testing::Test::HasFailure(); ++step) {
    SCOPED_TRACE("step " + std::to_string(step));
    motion.step();
    std::vector<test::Truth> truth;
    for (std::size_t i = 0; i < count; ++i) {
      truth.push_back(test::truth_of(links().link(i), motion.X_FL[i], motion.points, motion.cloud));
    }
    const int kind = static_cast<int>(test::uniform(&motion.rng, 0.0, 4.0));
    if (kind == 0) {
      ASSERT_TRUE(query.run(motion.X_FL, known, {&motion.cloud}, &results));
      for (std::size_t i = 0; i < count; ++i) {
        test::expect_truth(results[i], truth[i], config, motion.X_FL[i]);
        contact += results[i].state == LinkState::kContact ? 1 : 0;
      }
    } else if (kind == 1) {
      const std::size_t i = motion.rng() % count;
      results.resize(1);
      ASSERT_TRUE(query.run_link(i, motion.X_FL[i], {&motion.cloud}, &results[0]));
      test::expect_truth(results[0], truth[i], config, motion.X_FL[i]);
    } else {
      ASSERT_TRUE(query.run_minimum(motion.X_FL, known, {&motion.cloud}, &robot));
      expect_minimum(robot, truth, motion, config);
    }
  }
  EXPECT_GT(contact, steps / 50);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, CoherentQueries, ::testing::Values(0.0, 0.001, 0.02));

// A deadline may stop a query anywhere. The bounds of this query and of later ones hold.
TEST(CoherentQueries, BoundsHoldAfterDeadlines) {
  Motion motion(63);
  QueryConfig config;
  ProximityQuery query(links().shared_model(), config);
  const std::size_t count = motion.X_FL.size();
  const std::vector<bool> known(count, true);
  std::vector<LinkProximity> results;
  RobotProximity robot;
  int stopped = 0;
  for (int step = 0; step < test::scaled(900); ++step) {
    motion.step();
    config.deadline =
        step % 3 == 0 ? 0.0 : 1e-6 * std::pow(10.0, test::uniform(&motion.rng, -1.0, 2.5));
    query.set_config(config);
    const bool all = step % 2 == 0;
    const bool complete = all ? query.run(motion.X_FL, known, {&motion.cloud}, &results)
                              : query.run_minimum(motion.X_FL, known, {&motion.cloud}, &robot);
    stopped += complete ? 0 : 1;
    double least = kInfinity;
    for (std::size_t i = 0; i < count; ++i) {
      const double truth =
          test::truth_of(links().link(i), motion.X_FL[i], motion.points, motion.cloud).measured;
      least = std::min(least, truth);
      if (!all) continue;
      ASSERT_LE(results[i].lower_bound, truth + (std::abs(truth) < 2e-8 ? 2e-8 : 0.0))
          << "step " << step;
      if (complete) ASSERT_LE(results[i].distance, truth + config.tolerance + 1e-6);
    }
    if (all) continue;
    ASSERT_LE(robot.nearest.lower_bound, least + (std::abs(least) < 2e-8 ? 2e-8 : 0.0))
        << "step " << step;
    if (complete) ASSERT_LE(robot.nearest.distance, least + config.tolerance + 1e-6);
  }
  EXPECT_GT(stopped, 0);
}

// A point passes through the opening of a box, where its signed distance jumps, while another point
// or another link is the nearest.
TEST(CoherentQueries, BoundsHoldThroughAHole) {
  const TriangleMesh open = test::open_box({0.15, 0.1, 0.2});
  const auto model = test::make_model({Box{{0.02, 0.02, 0.02}}, open}, 0.005);
  const std::vector<bool> known(2, true);
  const Points points = {{0, 0, 0}, {0.095, 0, 0}};
  const CloudSnapshot cloud = test::make_snapshot(points);
  for (const double tolerance : {0.0, 0.001, 0.05}) {
    QueryConfig config;
    config.tolerance = tolerance;
    ProximityQuery query(model, config), minimum(model, config);
    std::vector<LinkProximity> results;
    RobotProximity robot;
    Poses X_FL(2, Eigen::Isometry3d::Identity());
    X_FL[0].translation().x() = 0.12;  // 1.5 cm from the point on the right
    int contacts = 0;
    for (double z = -0.25; z < 0.25; z += 0.0007) {
      X_FL[1].translation().z() = z;
      const double truth = test::oracle_minimum(
          open, {X_FL[1].inverse() * points[0], X_FL[1].inverse() * points[1]});
      query.run(X_FL, known, {&cloud}, &results);
      ASSERT_LE(results[1].lower_bound, truth) << z;
      ASSERT_LE(results[1].distance, truth + tolerance + 1e-6) << z;
      minimum.run_minimum(X_FL, known, {&cloud}, &robot);
      ASSERT_LE(robot.nearest.lower_bound, truth) << z;
      ASSERT_LE(robot.nearest.distance, truth + tolerance + 1e-6) << z;
      contacts += truth < 0.0 ? 1 : 0;
    }
    EXPECT_GT(contacts, 100);
  }
}

// A map moves while the links stand still.
TEST(CoherentQueries, BoundsHoldWhenAMapMoves) {
  test::Rng rng(64);
  CloudSnapshot map = test::make_map({{Eigen::Vector3d(0.5, -1, -1), Eigen::Vector3d(1, 1, 1)}});
  const auto model = test::make_model({Sphere{0.1}, Box{{0.2, 0.2, 0.2}}}, 0.005);
  ProximityQuery query(model, {});
  const Poses X_FL(2, Eigen::Isometry3d::Identity());
  const std::vector<bool> known(2, true);
  std::vector<LinkProximity> results;
  for (int step = 0; step < 200; ++step) {
    const double to_map =
        step % 2 == 0 ? test::uniform(&rng, 0.11, 0.9) : 0.5 + map.X_FM.translation().x();
    map.X_FM.translation().x() = to_map - 0.5;
    ASSERT_TRUE(query.run(X_FL, known, {&map}, &results));
    for (const LinkProximity& link : results) {
      ASSERT_LE(link.lower_bound, to_map - 0.1);
      ASSERT_NEAR(link.distance, to_map - 0.1, 0.001 + 1e-6);
    }
  }
}

// Many points are nearly as near as the answer, so that a large tolerance prunes most of them by
// the distances kept from earlier poses: what was pruned counts in the bound.
TEST(CoherentQueries, BoundsHoldAmongManyPointsOfNearlyTheSameDistance) {
  test::Rng rng(66);
  const std::size_t count = shapes().size();
  QueryConfig config;
  for (const double tolerance : {0.005, 0.02}) {
    config.tolerance = tolerance;
    for (int scene = 0; scene < test::scaled(20); ++scene) {
      Points points;
      for (int i = 0; i < 300; ++i) {
        points.push_back(test::uniform(&rng, 0.45, 0.47) *
                         test::random_vector(&rng, 1.0).normalized());
      }
      const CloudSnapshot cloud = test::make_snapshot(points);
      ProximityQuery query(links().shared_model(), config);
      Poses X_FL(count);
      std::vector<LinkProximity> results;
      for (int step = 0; step < 20; ++step) {
        for (Eigen::Isometry3d& X : X_FL) {
          X = displaced(Eigen::Isometry3d::Identity(), Eigen::Vector3d::Zero(), 0.02 * step,
                        Eigen::Vector3d::UnitZ(), test::random_vector(&rng, 0.003));
        }
        query.run(X_FL, std::vector<bool>(count, true), {&cloud}, &results);
        for (std::size_t i = 0; i < count; ++i) {
          const test::Truth truth = test::truth_of(links().link(i), X_FL[i], points, cloud);
          test::expect_truth(results[i], truth, config, X_FL[i]);
        }
      }
    }
  }
}

// Beside the rounding of a range without end, 1 km, a float has lost the digits of a bound: another
// point passed for the nearest one, and its distance for proven.
TEST(CoherentQueries, BoundsKeepTheirDigitsWhereTheRangeHasNoEnd) {
  test::Rng rng(41);
  Points points;
  for (int i = 0; i < 300; ++i) {
    points.push_back(test::random_vector(&rng, 1.0).normalized() *
                     test::uniform(&rng, 0.3, 0.3001));
  }
  const CloudSnapshot cloud = test::make_snapshot(points);
  points = test::stored_points(cloud.index);
  constexpr double kRadius = 0.1;
  QueryConfig near, endless;
  near.tolerance = endless.tolerance = 0.0;
  endless.max_distance = kInfinity;
  ProximityQuery query(test::make_model({Sphere{kRadius}}, 0.005), near);
  std::vector<LinkProximity> results;
  for (int step = 0; step < 200; ++step) {
    const Eigen::Vector3d p = test::random_vector(&rng, 1e-4);
    double truth = kInfinity;
    for (const Eigen::Vector3d& q : points) truth = std::min(truth, (q - p).norm() - kRadius);
    query.set_config(step % 2 == 0 ? near : endless);
    query.run({Eigen::Isometry3d(Eigen::Translation3d(p))}, {true}, {&cloud}, &results);
    ASSERT_LE(results[0].lower_bound, truth + 1e-12) << step;
    ASSERT_NEAR(results[0].distance, truth, 1e-7) << step;
  }
}

// A bound kept from another pose may say that nothing is deeper than the tolerance. Where the last
// obstacle touches the link at exactly 0, that does not settle the query: another one may be
// inside. All numbers are multiples of 2^-12 m, so that touch is exact.
TEST(CoherentQueries, ATouchDoesNotHideAPointInside) {
  test::Rng rng(65);
  const auto model = test::make_model({Box{{0.25, 0.25, 0.25}}}, 0.01);
  const auto steps = [&rng](int low, int high) {
    return std::floor(test::uniform(&rng, low, high + 1)) / 4096.0;
  };
  int inside = 0;
  for (int trial = 0; trial < test::scaled(1000); ++trial) {
    Points points;
    for (int i = 0; i < 200; ++i) {
      points.emplace_back(0.125 + steps(0, 3), test::uniform(&rng, -0.1, 0.1),
                          test::uniform(&rng, -0.1, 0.1));
    }
    const CloudSnapshot cloud = test::make_snapshot(points);
    QueryConfig config;
    config.tolerance = 0.002;
    ProximityQuery query(model, config);
    std::vector<LinkProximity> results;
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    for (int step = 0; step < 6; ++step) {
      X_FL.translation().x() = steps(-4, 4);
      double truth = kInfinity;
      for (const Eigen::Vector3d& p : points) {
        truth = std::min(truth, p.x() - X_FL.translation().x() - 0.125);
      }
      query.run({X_FL}, {true}, {&cloud}, &results);
      EXPECT_LE(results[0].lower_bound, truth);
      if (truth > -1e-4) continue;
      ++inside;
      ASSERT_EQ(results[0].state, LinkState::kContact) << "trial " << trial << ", step " << step;
    }
  }
  EXPECT_GT(inside, test::scaled(1000));
}

}  // namespace
}  // namespace ist
