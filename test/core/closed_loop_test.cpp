// The simulated robot dodges obstacles and is not repelled by itself: simulator, ingest, query,
// repulsion and the example controller together. benchmark/closed_loop.cpp and
// benchmark/self_view.cpp are the longer measurements.

#include "closed_loop.h"

#include <gtest/gtest.h>

#include "self_view.h"
#include "support/demo_arm.h"
#include "support/sanitizers.h"

namespace ist::sim {
namespace {

// Runs scenes without avoidance and with it, and gives both results to `judge`.
template <class Judge>
void compare(ClosedLoopConfig config, const SceneRules& rules, double duration, Avoidance avoidance,
             std::uint64_t scenes, const Judge& judge) {
  const RobotDescription robot = test::demo_robot();
  const auto nominal = [&](const Scene& scene) {
    return nominal_motion(robot, scene, config.controller);
  };
  for (std::uint64_t seed = 1; seed <= (test::kSanitized ? 1 : scenes); ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    Scene scene = make_scene(robot, seed, rules, nominal);
    scene.duration = duration;
    scene.patience = 4.0;
    config.avoidance = Avoidance::kNone;
    const ClosedLoopResult blind = run_closed_loop(robot, test::demo_model(), scene, seed, config);
    config.avoidance = avoidance;
    judge(blind, run_closed_loop(robot, test::demo_model(), scene, seed, config));
  }
}

// Each scene has one obstacle, which hits the arm if the arm does not dodge.
TEST(ClosedLoop, TheArmDodges) {
  SceneRules rules;
  rules.obstacles = 1;
  rules.first_aim = 2.0;
  int collisions = 0;
  compare({}, rules, 4.0, Avoidance::kBlend, 2, [&](const auto& blind, const auto& seeing) {
    collisions += blind.smallest_distance <= 0.0 ? 1 : 0;
    EXPECT_GT(seeing.smallest_distance, 0.02) << seeing.link;
    EXPECT_LT(seeing.smallest_distance, 0.3) << "nothing came near";
  });
  EXPECT_GT(collisions, 0);
}

// A body stands in the way of the blind arm.
TEST(ClosedLoop, TheFilterDrivesIntoNothing) {
  ClosedLoopConfig config;
  config.control_period = 10;
  config.remember = true;
  SceneRules rules;
  rules.obstacles = 0;
  rules.clutter = 3;
  int collisions = 0;
  compare(config, rules, 4.0, Avoidance::kFilter, 4, [&](const auto& blind, const auto& seeing) {
    collisions += blind.driven_at_touch > 0.1 ? 1 : 0;
    EXPECT_GT(seeing.smallest_distance, 0.0) << seeing.link;
  });
  // The single scene of a sanitizer's run need not have a collision.
  if (!test::kSanitized) EXPECT_GT(collisions, 0);
}

// The arm, folded below its base, swings its gripper through its stand.
TEST(ClosedLoop, TheFilterKeepsLinksApart) {
  ClosedLoopConfig config;
  config.control_period = 10;
  const Arm arm(test::demo_robot(), demo_arm());
  OwnDistances own(test::demo_robot(), test::demo_model(), config.query);
  SceneRules rules;
  rules.obstacles = 0;
  rules.goal_clearance = 0.12;
  rules.own_distance = [&](const Eigen::VectorXd& q) { return own.least(arm.link_poses(q)); };
  compare(config, rules, 0.0, Avoidance::kFilter, 3, [](const auto& blind, const auto& seeing) {
    EXPECT_LE(blind.own_distance, 0.0);
    EXPECT_GT(blind.driven_at_touch, 0.005);
    EXPECT_GT(seeing.own_distance, 0.0);
    EXPECT_LT(seeing.own_distance, 0.02) << "it did not come near";
  });
}

// A minute of moving in view of a camera with 5 mm of noise and 50 ms of latency.
TEST(SelfView, NoFalseContactInAMinute) {
  SelfViewConfig config;
  config.duration = test::kSanitized ? 3.0 : 60.0;
  const SelfViewResult result = run_self_view(test::demo_robot(), test::demo_model(), config).at(0);
  EXPECT_GT(result.on_robot, test::kSanitized ? 10000U : 400000U);
  EXPECT_EQ(result.phantoms, 0U);
  EXPECT_EQ(result.contacts, 0);
  EXPECT_TRUE(std::isinf(result.smallest_distance)) << result.smallest_distance;
}

// The padding that removes all of the robot's own points keeps those of a sphere 4 cm away.
TEST(SelfView, ANearbyObstacleIsStillFound) {
  SelfViewConfig config;
  config.duration = test::kSanitized ? 3.0 : 20.0;
  config.ball_distance = 0.042;
  const SelfViewResult result = run_self_view(test::demo_robot(), test::demo_model(), config).at(0);
  EXPECT_GT(result.near, result.answers / 2);
  EXPECT_LT(result.largest_excess, 0.03);
  EXPECT_EQ(result.phantoms, 0U);
}

}  // namespace
}  // namespace ist::sim
