#include "ist_proximity/repulsion/repulsion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/box_oracle.h"
#include "support/scene.h"

namespace ist {
namespace {

using Eigen::Vector3d;

constexpr double kStep = 1e-3;  // [s]

LinkProximity near_by(double distance) {
  LinkProximity proximity;
  proximity.state = distance < 0.0 ? LinkState::kContact : LinkState::kNear;
  proximity.distance = proximity.lower_bound = distance;
  return proximity;
}

// The distance is far below the influence distance, where the length does not fade.
const LinkProximity kNear = near_by(0.1);

RepulsiveWrench push(double x) { return {Vector3d(x, 0.0, -0.5 * x), Vector3d(0.0, 2.0 * x, 0.0)}; }

TEST(RepulsionFilter, passesChangesByTheRobotsMotion) {
  RepulsionFilter filter;
  for (int i = 0; i < 200; ++i) {
    const RepulsiveWrench raw = push(0.3 * std::sin(0.1 * i));
    const RepulsiveWrench out = filter.update(kStep * i, 7, raw, kNear, {});
    EXPECT_EQ(out.force, raw.force);
    EXPECT_EQ(out.torque, raw.torque);
  }
}

TEST(RepulsionFilter, spreadsChangesByANewCloud) {
  RepulsionConfig config;
  config.filter_time = 0.08;
  RepulsionFilter filter;
  filter.update(0.0, 1, push(0.0), kNear, config);
  double last = 0.0, delay = 0.0;
  for (int i = 1; i <= 1000; ++i) {
    const RepulsiveWrench out = filter.update(kStep * i, 2, push(0.5), kNear, config);
    const double done = out.force.x() / 0.5;
    EXPECT_GE(done, last) << i;
    EXPECT_LE(done, 1.0) << "no overshoot";
    EXPECT_LE(done - last, 0.74 * kStep / config.filter_time + 1e-12) << i;
    // Force and torque follow the closed form.
    const double t = kStep * i / (0.5 * config.filter_time);
    EXPECT_NEAR(done, 1.0 - (1.0 + t) * std::exp(-t), 1e-12);
    EXPECT_NEAR(out.torque.y(), 2.0 * out.force.x(), 1e-12);
    delay += (1.0 - done) * kStep;
    last = done;
  }
  EXPECT_NEAR(delay, config.filter_time, kStep) << "the mean delay is filter_time";
}

// Each update has a new cloud, and more than the filter's time is between them: the delay does not
// grow.
TEST(RepulsionFilter, slowUpdatesAreHardlyDelayed) {
  RepulsionFilter filter;
  for (int i = 0; i < 20; ++i) {
    const RepulsiveWrench out =
        filter.update(0.5 * i, static_cast<std::uint64_t>(i), push(0.5 * (i % 2)), kNear, {});
    EXPECT_NEAR(out.force.x(), 0.5 * (i % 2), 1e-6);
  }
}

// Changes of many clouds add up: the filter is linear.
TEST(RepulsionFilter, followsARampWithItsDelay) {
  RepulsionFilter filter;
  RepulsionConfig config;
  config.filter_time = 0.05;
  RepulsiveWrench out;
  for (int i = 0; i <= 1000;
       ++i) {  // an obstacle approaches for a second, with a new cloud every 2 ms
    out = filter.update(kStep * i, static_cast<std::uint64_t>(i / 2), push(0.4e-3 * (i - i % 2)),
                        kNear, config);
  }
  EXPECT_NEAR(out.force.x(), 0.4 * (1.0 - config.filter_time), 0.4 * 2.1e-3);
}

TEST(RepulsionFilter, repulsionEndsAtOnceOutsideTheInfluenceDistance) {
  LinkProximity clear;
  clear.state = LinkState::kClear;
  clear.distance = std::numeric_limits<double>::infinity();
  for (const LinkProximity& gone : {clear, near_by(0.3), near_by(0.5)}) {
    RepulsionFilter filter;
    filter.update(0.0, 1, push(0.8), kNear, {});
    EXPECT_TRUE(filter.update(kStep, 2, {}, gone, {}).force.isZero(0.0));
    // It returns smoothly, so an obstacle that is missing in one cloud makes less flicker.
    const RepulsiveWrench back = filter.update(2 * kStep, 3, push(0.8), kNear, {});
    EXPECT_GT(back.force.x(), 0.0);
    EXPECT_LT(back.force.x(), 0.01);
  }
  // The length fades towards the influence distance, whatever the filter holds.
  RepulsionFilter filter;
  filter.update(0.0, 1, push(0.8), kNear, {});
  double last = filter.update(kStep, 2, push(0.01), near_by(0.269), {}).force.norm();
  EXPECT_GT(last, 0.8);
  for (double distance = 0.27; distance < 0.3; distance += 0.001) {
    const double length = filter.update(kStep, 2, push(0.01), near_by(distance), {}).force.norm();
    EXPECT_LE(length, (1.0 - distance / 0.3) / 0.1 + 1e-12);
    EXPECT_LT(last - length, 0.04) << distance;
    last = length;
  }
}

TEST(RepulsionFilter, startsAnew) {
  const RepulsiveWrench raw = push(0.5);
  const auto fresh = [](const RepulsiveWrench& out, const RepulsiveWrench& expected) {
    EXPECT_EQ(out.force, expected.force);
    EXPECT_EQ(out.torque, expected.torque);
  };
  RepulsionFilter filter;
  fresh(filter.update(5.0, 1, raw, kNear, {}), raw);
  fresh(filter.update(4.0, 2, push(0.1), kNear, {}), push(0.1));  // the clock has jumped back
  EXPECT_TRUE(filter.update(4.1, 3, RepulsiveWrench::unknown(), LinkProximity(), {})
                  .force.array()
                  .isNaN()
                  .all());
  fresh(filter.update(4.2, 4, raw, kNear, {}), raw);
  filter.reset();
  fresh(filter.update(4.3, 5, push(0.2), kNear, {}), push(0.2));
  RepulsionConfig off;
  off.filter_time = 0.0;
  fresh(filter.update(4.4, 6, raw, kNear, off), raw);
}

// What is late is the last blend, turned with the link and as long as the distance says; let go in
// time, and not known then.
TEST(RepulsionFilter, holdsTheLastWrenchWhereOneIsLate) {
  const RepulsiveWrench late = RepulsiveWrench::unknown();
  for (const double filter_time : {0.0, 0.05}) {
    RepulsionConfig config;
    config.filter_time = filter_time;
    RepulsionFilter filter;
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    const RepulsiveWrench first = filter.update(0.0, 1, push(0.5), kNear, config, X_FL);
    double time = 0.0, distance = 0.1;
    while (time + kStep < RepulsionFilter::kHoldTime) {
      time += kStep;
      distance += 2e-4;
      X_FL.prerotate(Eigen::AngleAxisd(2e-3, Vector3d::UnitZ()));
      const RepulsiveWrench held = filter.update(time, 1, late, near_by(distance), config, X_FL);
      const double share = (1.0 - distance / 0.3) / (1.0 - 0.1 / 0.3);
      EXPECT_LT((held.force - share * (X_FL.linear() * first.force)).norm(), 1e-12) << time;
      EXPECT_LT((held.torque - share * (X_FL.linear() * first.torque)).norm(), 1e-12) << time;
    }
    // A blend that comes at last is spread as the change of a new cloud is.
    RepulsionFilter back = filter;
    const RepulsiveWrench held = back.update(time, 1, late, near_by(distance), config, X_FL);
    const RepulsiveWrench next =
        back.update(time + kStep, 1, push(-0.3), near_by(distance), config, X_FL);
    if (filter_time > 0.0) EXPECT_LT((next.force - held.force).norm(), 0.74 * kStep / 0.05);
    if (filter_time == 0.0) EXPECT_EQ(next.force, push(-0.3).force);
    EXPECT_TRUE(
        filter.update(time + 2 * kStep, 1, late, kNear, config, X_FL).force.array().isNaN().all());
    EXPECT_TRUE(filter.update(time + 3 * kStep, 1, late, kNear, config).force.hasNaN()) << "once";
    EXPECT_EQ(filter.update(time + 4 * kStep, 1, push(0.2), kNear, config).force, push(0.2).force);
  }
}

TEST(RepulsionFilter, holdsTheNearestPointWhereNothingWasBlended) {
  const RepulsiveWrench late = RepulsiveWrench::unknown();
  RepulsionFilter filter;
  // Before the first blend, and where the last one was zero, the nearest point's is held.
  LinkProximity first = near_by(0.29), other = near_by(0.29);
  first.direction = Vector3d::UnitX();
  other.direction = Vector3d::UnitY();
  first.p_FCl = other.p_FCl = Vector3d::Zero();
  const RepulsionConfig config;
  const Vector3d expected = (1.0 - 0.29 / 0.3) * Vector3d::UnitX();
  EXPECT_LT((filter.update(0.0, 1, late, first, config).force - expected).norm(), 1e-12);
  EXPECT_LT((filter.update(0.01, 1, late, other, config).force - expected).norm(), 1e-12);
  for (const double time : {0.3, 0.31, 0.9}) {
    EXPECT_TRUE(filter.update(time, 1, late, other, config).force.hasNaN()) << time;
  }
  filter.update(1.0, 1, {}, near_by(0.4), config);
  EXPECT_LT((filter.update(1.01, 1, late, first, config).force - expected).norm(), 1e-12);
  EXPECT_LT((filter.update(1.02, 1, late, other, config).force - expected).norm(), 1e-12);
  filter.reset();
  // From the influence distance on the length is 0, late or not.
  filter.update(0.2, 1, push(0.5), kNear, {});
  EXPECT_TRUE(filter.update(0.201, 1, late, near_by(0.3), {}).force.isZero(0.0));
  EXPECT_TRUE(filter.update(9.0, 1, late, near_by(0.3), {}).force.isZero(0.0));
  // A link that is UNKNOWN in between forgets.
  filter.update(9.1, 1, push(0.5), kNear, {});
  filter.update(9.11, 1, late, LinkProximity(), {});
  EXPECT_LT((filter.update(9.12, 1, late, first, {}).force - expected).norm(), 1e-12);
}

TEST(RepulsionFilter, recognizesNewClouds) {
  const CloudSnapshot a = test::make_snapshot({{0, 0, 0}}), b = test::make_snapshot({{0, 0, 0}});
  const Eigen::AlignedBox3d box(Vector3d(0, 0, 0), Vector3d(1, 1, 1));
  const CloudSnapshot map = test::make_map({box});
  const std::uint64_t key = obstacles_key({&a, &map});
  EXPECT_EQ(key, obstacles_key({&a, &map}));
  CloudSnapshot moved = map;  // the map's frame moves as the robot drives, but it is the same map
  moved.X_FM.translation().x() = 1.0;
  EXPECT_EQ(key, obstacles_key({&a, &moved}));
  const CloudSnapshot next = test::make_map({box});  // built anew: the map may have changed
  EXPECT_NE(key, obstacles_key({&a, &next}));
  for (const auto& other : {obstacles_key({&b, &map}), obstacles_key({&a}),
                            obstacles_key({&map, &a}), obstacles_key({})}) {
    EXPECT_NE(key, other);
  }
}

}  // namespace
}  // namespace ist
