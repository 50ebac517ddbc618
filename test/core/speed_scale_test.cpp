#include "ist_proximity/proximity/speed_scale.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/robot/link_poses.h"
#include "support/allocations.h"
#include "support/demo_arm.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRange = 1.0;  // [m] max_distance

SpeedScaleInput near(double bound) {
  return {bound < 0.0 ? LinkState::kContact : LinkState::kNear, bound};
}
SpeedScaleInput clear() { return {LinkState::kClear, kRange}; }

// A robot of one link.
class OneLink : public ::testing::Test {
 protected:
  SpeedScaleAnswer run(const SpeedScaleInput& input, double age = 0.05) {
    return scale.update(config, {input}, {true}, age);
  }
  double at(double bound) { return run(near(bound)).scale; }

  SpeedScaleConfig config;
  SpeedScale scale{{"arm"}};
};

TEST_F(OneLink, StopsSlowsAndIsFree) {
  config.hysteresis = 0.0;
  EXPECT_EQ(at(config.stop_distance), 0.0);
  EXPECT_EQ(run(near(config.stop_distance)).rule, SpeedRule::kStop);
  EXPECT_EQ(at(-0.02), 0.0);
  EXPECT_EQ(at(-kInfinity), 0.0);
  EXPECT_NEAR(at(0.5 * (config.stop_distance + config.free_distance)), 0.5, 1e-12);
  EXPECT_EQ(run(near(0.2)).rule, SpeedRule::kSlow);
  EXPECT_EQ(run(near(0.2)).link, 0);
  EXPECT_EQ(run(near(0.2)).bound, 0.2);
  EXPECT_EQ(at(config.free_distance), 1.0);
  EXPECT_EQ(run(near(config.free_distance)).rule, SpeedRule::kFree);
  EXPECT_EQ(run(clear()).scale, 1.0);

  config.slow_distance = 0.25;
  config.slow_scale = 0.2;
  EXPECT_NEAR(at(0.25), 0.2, 1e-12);
  EXPECT_NEAR(at(0.175), 0.1, 1e-12);
  EXPECT_NEAR(at(0.275), 0.6, 1e-12);
}

TEST_F(OneLink, WhatIsNotKnownStops) {
  EXPECT_EQ(run(clear()).scale, 1.0);
  for (const SpeedScaleInput& input :
       {SpeedScaleInput{}, near(kNaN), SpeedScaleInput{LinkState::kClear, kNaN},
        SpeedScaleInput{LinkState::kUnknown, 1.0}}) {
    const SpeedScaleAnswer answer = run(input);
    EXPECT_EQ(answer.scale, 0.0);
    EXPECT_EQ(answer.rule, SpeedRule::kUnknown);
    EXPECT_EQ(answer.link, 0);
    EXPECT_TRUE(std::isnan(answer.bound));
  }
  // Nothing counts, and inputs that are not the robot's.
  EXPECT_EQ(scale.update(config, {clear()}, {false}, 0.0).scale, 0.0);
  EXPECT_EQ(scale.update(config, {}, {}, 0.0).scale, 0.0);
  EXPECT_EQ(scale.update(config, {clear(), clear()}, {true, true}, 0.0).scale, 0.0);
  EXPECT_EQ(SpeedScale({}).update(config, {}, {}, 0.0).rule, SpeedRule::kUnknown);
  // A distance of a link that is not there was meant for another one.
  config.links.push_back({"amr", 0.5, 0.9});
  EXPECT_EQ(run(clear()).rule, SpeedRule::kUnknown);
  EXPECT_EQ(scale.unknown_links(config), std::vector<std::string>{"amr"});
  config.links[0].link = "arm";
  EXPECT_EQ(run(clear()).scale, 1.0);
}

TEST_F(OneLink, HysteresisHoldsTheScaleWhileTheBoundRises) {
  config.hysteresis = 0.03;
  EXPECT_NEAR(at(0.2), 0.5, 1e-12);
  EXPECT_NEAR(at(0.229), 0.5, 1e-12);  // held
  EXPECT_NEAR(at(0.15), 0.25, 1e-12);  // downward at once
  EXPECT_NEAR(at(0.20), 0.35, 1e-12);  // 3 cm behind
  EXPECT_EQ(at(0.1), 0.0);
  EXPECT_EQ(at(0.129), 0.0);
  EXPECT_EQ(run(near(0.129)).rule, SpeedRule::kStop);
  EXPECT_GT(at(0.14), 0.0);
  EXPECT_EQ(run(clear()).scale, 1.0);
  EXPECT_NEAR(at(0.2), 0.5, 1e-12);
  scale.reset();
  EXPECT_NEAR(at(0.29), 0.95, 1e-12);
}

// Where unknown space counts, a CLEAR link's bound is small and noisy. It decides, as any link's
// does.
TEST_F(OneLink, ClearLinkIsHeldByItsOwnBound) {
  const auto unseen = [](double bound) { return SpeedScaleInput{LinkState::kClear, bound}; };
  EXPECT_EQ(run(unseen(0.021)).scale, 0.0);
  EXPECT_EQ(run(unseen(0.021)).rule, SpeedRule::kStop);
  EXPECT_EQ(run(unseen(0.021)).bound, 0.021);
  EXPECT_EQ(run(unseen(-0.05)).scale, 0.0);
  EXPECT_NEAR(run(unseen(0.23)).scale, 0.5, 1e-12);
  EXPECT_NEAR(run(unseen(0.229)).scale, 0.495 + 0.005, 1e-12);  // held since 0.20
  EXPECT_EQ(run(unseen(-kInfinity)).scale, 0.0);
  EXPECT_EQ(run(clear()).scale, 1.0);
  EXPECT_EQ(run(clear()).bound, kRange);
  // Nothing in a range that is no longer than the free distance is free.
  config.free_distance = kRange;
  EXPECT_LT(run(unseen(0.9)).scale, 1.0);
  EXPECT_EQ(run(clear()).scale, 1.0);
  config.separation.enabled = true;
  EXPECT_EQ(run(unseen(0.05)).scale, 0.0);
}

// A bound with 5 mm of noise (standard deviation), anywhere between contact and free: without
// hysteresis the scale changes at every cycle and the robot starts and stops for ever.
TEST_F(OneLink, NoChatterUnder5mmNoise) {
  std::mt19937_64 rng(1);
  std::normal_distribution<double> noise(0.0, 0.005);
  int starts = 0, starts_without = 0, cycles = 0;
  double wobble = 0.0, wobble_without = 0.0;
  SpeedScale other({"arm"});
  SpeedScaleConfig without = config;
  without.hysteresis = 0.0;
  for (double mean = 0.08; mean < 0.32; mean += 0.004) {
    scale.reset();
    double last = at(mean - 0.015), last_without = 0.0;
    for (int i = 0; i < 1000; ++i, ++cycles) {
      const double bound = mean + noise(rng);
      const double now = at(bound);
      const double plain = other.update(without, {near(bound)}, {true}, 0.0).scale;
      starts += last == 0.0 && now > 0.0 ? 1 : 0;
      starts_without += last_without == 0.0 && plain > 0.0 ? 1 : 0;
      wobble += std::abs(now - last);
      wobble_without += std::abs(plain - last_without);
      last = now;
      last_without = plain;
    }
  }
  EXPECT_LE(starts, 5) << "of " << cycles << " cycles";
  EXPECT_GT(starts_without, 500);
  EXPECT_LT(wobble / cycles, 2e-4);
  EXPECT_GT(wobble_without / cycles, 0.015);
}

TEST_F(OneLink, SeparationDistance) {
  config.hysteresis = 0.0;
  config.separation.enabled = true;
  const SeparationConfig& s = config.separation;
  ASSERT_TRUE(config_errors(config, "", 3.0).empty());
  // ISO 10218-2, forward: S = v_h (T_r + T_s) + v_r T_r + v_r T_s / 2 + C + Z.
  const auto distance = [&s](double v_r, double v_h, double age) {
    const double reaction = s.reaction_time + age;
    return v_h * (reaction + s.stopping_time) + v_r * reaction + 0.5 * v_r * s.stopping_time +
           s.intrusion + s.uncertainty;
  };
  for (const double age : {0.0, 0.08, 0.3}) {
    for (const double share : {0.1, 0.5, 0.99}) {
      SpeedScaleInput input = near(distance(share * s.robot_speed, 1.6, age));
      EXPECT_NEAR(run(input, age).scale, share, 1e-9);
      EXPECT_EQ(run(input, age).rule, SpeedRule::kSeparation);
      input.obstacle_speed = 0.4;  // less than K changes nothing, more does
      EXPECT_NEAR(run(input, age).scale, share, 1e-9);
      input = near(distance(share * s.robot_speed, 2.5, age));
      input.obstacle_speed = 2.5;
      EXPECT_NEAR(run(input, age).scale, share, 1e-9);
    }
    EXPECT_EQ(run(near(distance(0.0, 1.6, age)), age).scale, 0.0);
    EXPECT_EQ(run(near(distance(s.robot_speed, 1.6, age) + 0.001), age).scale, 1.0);
  }
  // Obstacles of unknown speed walk.
  config.separation.obstacle_speed = 0.0;
  EXPECT_NEAR(run(near(distance(0.5, 1.6, 0.1)), 0.1).scale, 0.5, 1e-9);
  SpeedScaleInput known = near(distance(0.5, 0.2, 0.1));
  known.obstacle_speed = 0.2;
  config.stop_distance = 0.01;
  config.free_distance = 0.02;
  EXPECT_NEAR(run(known, 0.1).scale, 0.5, 1e-9);
  EXPECT_EQ(run(near(3.0), kNaN).rule, SpeedRule::kUnknown);  // of unknown age
  EXPECT_EQ(run(near(3.0), 1e6).scale, 0.0);
  // CLEAR proves max_distance, and no more.
  EXPECT_LT(run({LinkState::kClear, 0.5}, 0.05).scale, 1.0);
}

// What the link reaches takes the place of the robot's speed and of its stopping time.
TEST_F(OneLink, SeparationDistanceByReach) {
  config.hysteresis = 0.0;
  config.separation.enabled = true;
  const SeparationConfig& s = config.separation;
  const StoppingReach reach{2.0, 0.4, 0.5};
  // Forward: until it stands, at the scale k, obstacles come v_h (T_r + k t) nearer, and the link
  // goes k v T_r + k^2 b.
  const auto distance = [&](double k, double v_h, double age) {
    const double reaction = s.reaction_time + age;
    return v_h * (reaction + k * reach.time) + k * reach.speed * reaction + k * k * reach.distance;
  };
  const auto scale_at = [&](double bound, double v_h, double age) {
    SpeedScaleInput input = near(bound);
    input.obstacle_speed = v_h;
    input.reach = reach;
    return run(input, age).scale;
  };
  for (const double age : {0.0, 0.3}) {
    for (const double k : {0.1, 0.5, 0.99}) {
      EXPECT_NEAR(scale_at(distance(k, 1.6, age), 0.4, age), k, 1e-9);
      EXPECT_NEAR(scale_at(distance(k, 2.5, age), 2.5, age), k, 1e-9);
    }
    EXPECT_EQ(scale_at(distance(0.0, 1.6, age), 0.4, age), 0.0);
    EXPECT_EQ(scale_at(distance(1.0, 1.6, age) + 0.001, 0.4, age), 1.0);
  }
  // A reach that is not known allows nothing.
  SpeedScaleInput input = near(2.0);
  input.reach = StoppingReach();
  EXPECT_EQ(run(input, 0.0).scale, 0.0);
  input.reach->speed = 1.0;
  EXPECT_EQ(run(input, 0.0).scale, 0.0);
  // Nor does it beside an obstacle that stands: 0 m/s for an endless time is no number.
  config.separation.obstacle_speed = input.obstacle_speed = 0.0;
  EXPECT_EQ(run(input, 0.0).scale, 0.0);
  EXPECT_EQ(run(input, 0.0).rule, SpeedRule::kSeparation);
  input.reach = reach;
  EXPECT_EQ(run(input, 0.0).scale, 1.0);
}

TEST(SpeedScale, TheLinkThatAllowsLeastDecides) {
  SpeedScaleConfig config;
  config.hysteresis = 0.0;
  config.links.push_back({"hand", 0.02, LinkSpeedDistances::kAsRobot});
  config.links.push_back({"elbow", LinkSpeedDistances::kAsRobot, 0.9});
  SpeedScale scale({"hand", "elbow", "base"});
  const auto run = [&](double hand, double elbow, double base,
                       std::vector<bool> counts = {1, 1, 1}) {
    return scale.update(config, {near(hand), near(elbow), near(base)}, counts, 0.0);
  };
  EXPECT_EQ(run(0.5, 0.95, 0.5).rule, SpeedRule::kFree);
  EXPECT_EQ(run(0.5, 0.95, 0.5).scale, 1.0);
  SpeedScaleAnswer answer = run(0.16, 0.95, 0.5);
  EXPECT_EQ(answer.link, 0);
  EXPECT_NEAR(answer.scale, 0.5, 1e-12);  // between 0.02 and 0.3
  EXPECT_EQ(answer.stop_distance, 0.02);
  answer = run(0.16, 0.3, 0.5);
  EXPECT_EQ(answer.link, 1);
  EXPECT_NEAR(answer.scale, 0.25, 1e-12);  // between 0.1 and 0.9
  EXPECT_EQ(answer.free_distance, 0.9);
  EXPECT_EQ(run(0.16, 0.3, 0.0).rule, SpeedRule::kStop);
  EXPECT_EQ(run(0.16, 0.3, 0.0).link, 2);
  // A link that does not count may be anywhere, and unknown.
  EXPECT_EQ(run(0.5, 0.95, 0.0, {1, 1, 0}).scale, 1.0);
  EXPECT_EQ(run(0.5, 0.95, kNaN, {1, 1, 0}).scale, 1.0);
  EXPECT_EQ(run(0.5, 0.95, kNaN, {1, 1, 1}).scale, 0.0);
}

// Random robots, configurations and bounds: in 0 to 1, monotone in every bound, 0 for anything
// unknown, never more than without hysteresis, and never more than any link alone allows.
TEST(SpeedScale, RandomProperties) {
  test::Rng rng(3);
  for (int k = 0; k < 3000; ++k) {
    SpeedScaleConfig config;
    config.stop_distance = test::uniform(&rng, 0.0, 0.3);
    config.free_distance = config.stop_distance + test::uniform(&rng, 0.001, 0.6);
    config.hysteresis = test::uniform(&rng, 0.0, 0.1);
    if (k % 3 == 0) {
      config.slow_distance = test::uniform(&rng, config.stop_distance, config.free_distance);
      config.slow_scale = test::uniform(&rng, 0.0, 1.0);
    }
    config.separation.enabled = k % 4 == 0;
    config.separation.obstacle_speed = test::uniform(&rng, 0.0, 1.0);
    if (k % 2 == 0) config.links.push_back({"b", 0.5 * config.stop_distance, kNaN});
    if (!config_errors(config, "", kRange).empty()) continue;  // 0 for every robot
    SpeedScaleConfig without = config;
    without.hysteresis = 0.0;
    SpeedScale scale({"a", "b", "c"}), plain({"a", "b", "c"});
    const std::vector<bool> all(3, true);
    for (int i = 0; i < 20; ++i) {
      std::vector<SpeedScaleInput> links;
      for (int l = 0; l < 3; ++l) {
        links.push_back(near(test::uniform(&rng, -0.1, 1.0)));
        if (rng() % 2 == 0) links.back().obstacle_speed = test::uniform(&rng, -1.0, 2.0);
        if (rng() % 8 == 0) links.back() = clear();
      }
      const double age = test::uniform(&rng, 0.0, 0.2);
      const SpeedScaleAnswer answer = scale.update(config, links, all, age);
      const SpeedScaleAnswer free = plain.update(without, links, all, age);
      ASSERT_GE(answer.scale, 0.0);
      ASSERT_LE(answer.scale, 1.0);
      ASSERT_LE(answer.scale, free.scale + 1e-12);
      ASSERT_GE(answer.link, 0);
      ASSERT_LE(answer.bound, links[static_cast<std::size_t>(answer.link)].lower_bound);
      std::vector<SpeedScaleInput> nearer = links;
      SpeedScaleInput& one = nearer[rng() % 3];
      one.state = LinkState::kNear;
      one.lower_bound -= test::uniform(&rng, 0.0, 0.3);
      ASSERT_LE(plain.update(without, nearer, all, age).scale, free.scale + 1e-12);
      for (std::size_t l = 0; l < 3; ++l) {
        std::vector<bool> alone(3, false);
        alone[l] = true;
        ASSERT_LE(free.scale, plain.update(without, links, alone, age).scale + 1e-12);
      }
      links[rng() % 3] = SpeedScaleInput();
      ASSERT_EQ(scale.update(config, links, all, age).scale, 0.0);
    }
  }
}

TEST(SpeedScale, AllocatesNothing) {
  SpeedScaleConfig config;
  config.links.push_back({"b", 0.05, 0.4});
  SpeedScale scale({"a", "b"});
  const std::vector<SpeedScaleInput> links = {near(0.2), near(0.3)};
  const std::vector<bool> all(2, true);
  const long before = test::allocations.load();
  scale.update(config, links, all, 0.0);
  EXPECT_EQ(test::allocations.load(), before);
}

std::string only_error(const SpeedScaleConfig& config) {
  const std::vector<std::string> errors = config_errors(config, "~s/", kRange);
  return errors.size() == 1 ? errors[0] : std::to_string(errors.size()) + " errors";
}

TEST(SpeedScaleConfig, EachMistakeIsOneSentence) {
  EXPECT_TRUE(config_errors({}, "", kRange).empty());
  const auto expect = [](const char* text, void (*change)(SpeedScaleConfig*)) {
    SpeedScaleConfig config;
    change(&config);
    EXPECT_EQ(only_error(config), text);
  };
  using C = SpeedScaleConfig;
  expect("~s/stop_distance is 0.5 m: it must be less than ~s/free_distance, 0.3 m",
         [](C* c) { c->stop_distance = 0.5; });
  expect("~s/stop_distance is -0.1 m: it must be a number from 0 m up",
         [](C* c) { c->stop_distance = -0.1; });
  expect("~s/hysteresis is nan m: it must be a number from 0 m up",
         [](C* c) { c->hysteresis = kNaN; });
  expect("~s/slow_scale is 1.5: allowed is from 0 to 1", [](C* c) { c->slow_scale = 1.5; });
  expect("~s/slow_distance is 0.4 m: it must be less than ~s/free_distance, 0.3 m",
         [](C* c) { c->slow_distance = 0.4; });
  expect(
      "~s/free_distance is 1.5 m: it must not be more than ~max_distance, 1 m, because nothing "
      "farther away is measured",
      [](C* c) { c->free_distance = 1.5; });
  expect("~s/links/arm/stop_distance is 0.3 m: it must be less than ~s/free_distance, 0.3 m",
         [](C* c) {
           c->links.push_back({"arm", 0.3, kNaN});
         });
  expect("~s/separation/stopping_time is -1 s: it must be a number from 0 s up",
         [](C* c) { c->separation.stopping_time = -1.0; });
  expect(
      "~s/separation is 1.44 m for a robot that stands: the scale would always be 0, because "
      "~max_distance is 1 m",
      [](C* c) {
        c->separation.enabled = true;
        c->separation.stopping_time = 0.8;
      });
}

TEST(SpeedScaleConfig, DefaultsFitAShorterRange) {
  for (const double range : {0.01, 0.1, 0.25, 0.3, 2.0}) {
    const SpeedScaleConfig config = fitted_to({}, range);
    EXPECT_TRUE(config_errors(config, "", range).empty()) << range;
    EXPECT_EQ(config.free_distance, std::min(range, SpeedScaleConfig().free_distance));
  }
}

TEST(LinksThatMove, FixedJointsAloneDoNotMoveALink) {
  const auto description = test::demo_robot();
  const auto model = test::demo_model();
  const Kinematics kinematics(description);
  const std::vector<bool> moves = links_that_move(*model, kinematics, description.root_link);
  std::vector<std::string> fixed;
  for (std::size_t i = 0; i < moves.size(); ++i) {
    if (!moves[i]) fixed.push_back(model->links[i].name);
  }
  EXPECT_EQ(fixed, (std::vector<std::string>{"base_link", "stand_link"}));
  // In the gripper's frame everything else moves, and nothing is known of a frame elsewhere.
  const std::vector<bool> seen_from_gripper = links_that_move(*model, kinematics, "gripper_link");
  for (std::size_t i = 0; i < moves.size(); ++i) {
    EXPECT_EQ(seen_from_gripper[i], model->links[i].name != "gripper_link");
  }
  for (const bool move : links_that_move(*model, kinematics, "odom")) EXPECT_TRUE(move);
}

}  // namespace
}  // namespace ist
