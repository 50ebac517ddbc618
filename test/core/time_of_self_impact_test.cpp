#include "ist_proximity/proximity/time_of_self_impact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "support/motions.h"
#include "support/random_robots.h"
#include "support/sanitizers.h"
#include "support/world_oracle.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// A robot of boxes and spheres, whose distances have closed forms or few triangles.
test::Arm arm_of_boxes_and_spheres(test::Rng* rng) {
  static const test::LinkShapes kShapes(
      {Box{{0.1, 0.06, 0.3}}, Sphere{0.08}, Box{{0.2, 0.2, 0.02}}});
  RobotDescription robot = test::random_robot(rng, 6);
  for (JointDescription& joint : robot.joints) joint.X_PJ.translation() *= 0.25;
  return test::arm_of(robot, kShapes, rng);
}

std::vector<LinkPair> all_pairs(const test::Arm& arm) {
  std::vector<LinkPair> pairs;
  for (std::size_t i = 0; i < arm.size(); ++i) {
    for (std::size_t k = i + 1; k < arm.size(); ++k) pairs.push_back({i, k});
  }
  return pairs;
}

// [s] The first contact of two links by samples; +inf without any.
double sampled_impact(const test::Arm& arm, const std::vector<test::OracleSolid>& solids,
                      const test::ArmMotion& motion, const LinkPair& pair) {
  const auto distance = [&](double time) {
    const auto X_FB = test::sampled_poses(arm, motion, time);
    const Eigen::Isometry3d X_AB =
        X_FB[arm.bodies[pair.first]].inverse() * X_FB[arm.bodies[pair.second]];
    return solids[pair.first].distance(solids[pair.second], X_AB, kInf);
  };
  return test::sampled_contact(distance, motion.joints.duration);
}

// The time is never later than the one that dense sampling finds, and for 99 % of the
// pairs no more than 5 ms earlier.
TEST(TimeOfSelfImpact, randomMotionsAgainstDenseSampling) {
  test::Rng rng(71);
  test::ImpactCounts counts;
  int motions = 0;
  while (motions < test::scaled(400)) {
    const test::Arm arm = arm_of_boxes_and_spheres(&rng);
    const std::vector<LinkPair> pairs = all_pairs(arm);
    if (pairs.empty()) continue;
    const std::vector<test::OracleSolid> solids(arm.links.begin(), arm.links.end());
    QueryConfig config;
    config.max_distance = 0.5;
    TimeOfSelfImpact impacts(arm.model, arm.kinematics, pairs, config);
    std::vector<ImpactTime> found;
    for (int i = 0; i < 25 && motions < test::scaled(400); ++i) {
      test::ArmMotion motion = test::random_motion(&rng, arm);
      motion.joints.duration *= 2.0;  // twice as far, as fast
      for (std::size_t j = 0; j < motion.joints.to.size(); ++j) {
        motion.joints.to[j] += motion.joints.to[j] - motion.joints.from[j];
      }
      impacts.run(motion.joints, motion.still, std::vector<bool>(pairs.size(), true), &found);
      ++motions;
      for (std::size_t k = 0; k < pairs.size(); ++k) {
        const double truth = sampled_impact(arm, solids, motion, pairs[k]);
        if (truth == 0.0) {
          EXPECT_EQ(found[k].time, 0.0);
          continue;
        }
        counts.add(found[k].time, truth);
        EXPECT_LE(found[k].time, truth) << "motion " << motions << " pair " << k;
      }
    }
  }
  EXPECT_EQ(counts.late, 0);
  EXPECT_GE(counts.close, 0.99 * counts.all);
  EXPECT_LE(counts.alarms, 0.01 * counts.all);
  // A sanitizer leaves time for two arms only.
  if (!test::kSanitized) EXPECT_GT(counts.contacts, motions / 10) << "motions must be hard";
  EXPECT_GT(counts.all - counts.contacts, motions / 4);
}

// A turning column carries two arms with a sphere of 0.1 m each; the second arm turns too.
RobotDescription two_arms() {
  RobotDescription robot;
  robot.root_link = "base";
  robot.joints = {
      test::joint("turn", JointType::kContinuous, "base", "column", {0, 0, 0}, {0, 0, 1}),
      test::joint("first_tip", JointType::kFixed, "column", "first", {1, 0, 0}),
      test::joint("swing", JointType::kContinuous, "column", "arm", {0, 0, 0}, {0, 0, 1}),
      test::joint("second_tip", JointType::kFixed, "arm", "second", {0, 1, 0})};
  return robot;
}

struct TwoArms {
  TwoArms() : kinematics(std::make_shared<Kinematics>(two_arms())) {
    const auto shapes = test::make_model({Sphere{0.1}, Sphere{0.1}}, 0.01);
    const auto robot = std::make_shared<RobotModel>(*shapes);
    robot->links[0].name = "first";
    robot->links[1].name = "second";
    model = robot;
    kinematics->place_joints({0.0, 0.0, 0.0, 0.0}, &still);
  }
  ImpactTime run(double turn, double swing, double margin = 0.0) {
    QueryConfig config;
    config.max_distance = 3.0;
    config.margin = margin;
    TimeOfSelfImpact impacts(model, kinematics, {{0, 1}}, config);
    std::vector<ImpactTime> found;
    impacts.run({{0.0, 0.0, 0.0, 0.0}, {turn, 0.0, swing, 0.0}, 1.0}, still, {true}, &found);
    return found[0];
  }
  std::shared_ptr<const RobotModel> model;
  std::shared_ptr<Kinematics> kinematics;
  JointPoses still;
};

TEST(TimeOfSelfImpact, handComputed) {
  TwoArms robot;
  const double quarter = 0.5 * 3.14159265358979323846;
  // The centres are 2 sin(angle / 2) apart, and 0.2 m in touch.
  const auto touch_at = [&](double distance) {
    return (quarter - 2.0 * std::asin(0.5 * distance)) / quarter;
  };
  EXPECT_LE(robot.run(0.0, -quarter).time, touch_at(0.2));
  EXPECT_NEAR(robot.run(0.0, -quarter).time, touch_at(0.2), 1e-5);
  EXPECT_LE(robot.run(0.0, -quarter, 0.05).time, touch_at(0.25));
  EXPECT_NEAR(robot.run(0.0, -quarter, 0.05).time, touch_at(0.25), 1e-5);
  EXPECT_EQ(robot.run(0.0, quarter).time, kInf);
}

// A joint that carries both links does not bring them together: one distance is enough, however
// fast it turns.
TEST(TimeOfSelfImpact, jointsThatCarryBothDoNotCount) {
  TwoArms robot;
  const ImpactTime found = robot.run(100.0, 0.0);
  EXPECT_EQ(found.time, kInf);
  EXPECT_EQ(found.steps, 0);
  EXPECT_LE(robot.run(100.0, 0.3).steps, robot.run(0.0, 0.3).steps);
}

// What does not fit the model, and what is not known, gives no time at all.
TEST(TimeOfSelfImpact, unknownIsNotKnown) {
  TwoArms robot;
  TimeOfSelfImpact impacts(robot.model, robot.kinematics, {{0, 1}}, {});
  const JointMotion motion{{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}, 1.0};
  std::vector<ImpactTime> found;
  const auto is_unknown = [&](const JointMotion& joints, const JointPoses& still,
                              const std::vector<bool>& wanted) {
    impacts.run(joints, still, wanted, &found);
    return found.size() == 1 && std::isnan(found[0].time);
  };
  EXPECT_FALSE(is_unknown(motion, robot.still, {true}));
  EXPECT_TRUE(is_unknown(motion, robot.still, {false}));
  EXPECT_TRUE(is_unknown(motion, robot.still, {true, true}));
  EXPECT_TRUE(is_unknown(motion, JointPoses(), {true}));
  for (const double duration : {0.0, -1.0, std::nan(""), kInf}) {
    EXPECT_TRUE(is_unknown({motion.from, motion.to, duration}, robot.still, {true})) << duration;
  }
  JointPoses still = robot.still;  // the swing's position is not known, and it does not move
  still.known[2] = false;
  const double nan = std::nan("");
  EXPECT_TRUE(is_unknown({{0.0, 0.0, nan, 0.0}, {1.0, 0.0, nan, 0.0}, 1.0}, still, {true}));
}

}  // namespace
}  // namespace ist
