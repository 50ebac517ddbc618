// What a robot can still reach, against simulations of robots that brake.

#include "ist_proximity/proximity/stopping_reach.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"
#include "support/motions.h"
#include "support/random_robots.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// A robot at the beginning of a motion, whose joints move and brake.
struct Braking {
  test::Arm arm;
  test::ArmMotion motion;
  std::vector<double> velocities, decelerations;  // by joint
  std::vector<StoppingReach> links;               // by link
  std::vector<LinkBox> boxes;                     // by link

  // Poses with each joint's motion at a share of its time.
  std::vector<Eigen::Isometry3d> poses(const std::vector<double>& shares) const {
    test::ArmMotion there = motion;
    there.joints.duration = 1.0;
    for (std::size_t j = 0; j < shares.size(); ++j) {
      const double T = std::abs(velocities[j]) / decelerations[j], t = shares[j] * T;
      const double sign = velocities[j] < 0.0 ? -1.0 : 1.0;
      there.joints.from[j] += velocities[j] * t - sign * 0.5 * decelerations[j] * t * t;
    }
    there.joints.to = there.joints.from;
    return test::sampled_poses(arm, there, 0.0);
  }
};

Braking random_braking(test::Rng* rng) {
  Braking braking{test::random_arm(rng), {}, {}, {}, {}, {}};
  braking.motion = test::random_motion(rng, braking.arm);
  const auto& joints = braking.arm.kinematics->joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double fastest = joints[j].type == JointType::kPrismatic ? 0.5 : 2.0;
    if (!joints[j].is_free()) braking.motion.joints.from[j] = kNaN;  // a mimic joint follows
    const bool moves = !std::isnan(braking.motion.joints.from[j]) && test::uniform(rng, 0, 1) < 0.8;
    braking.velocities.push_back(moves ? test::uniform(rng, -fastest, fastest) : 0.0);
    braking.decelerations.push_back(test::uniform(rng, 0.5, 10.0));
    if (!joints[j].is_free()) braking.velocities.back() = kNaN;
  }
  std::vector<StoppingReach> stops;
  brake_joints(*braking.arm.kinematics, braking.velocities, braking.decelerations, &stops);
  const auto X_FB = test::sampled_poses(braking.arm, braking.motion, 0.0);
  braking.boxes = link_boxes(*braking.arm.model);
  for (std::size_t i = 0; i < braking.arm.size(); ++i) {
    braking.links.push_back(stopping_reach(*braking.arm.kinematics, stops, braking.arm.bodies[i],
                                           braking.boxes[i].box_L, X_FB));
  }
  return braking;
}

// [m] The farthest that a corner of a link's box has gone.
double moved(const LinkBox& box, const Eigen::Isometry3d& X_FA, const Eigen::Isometry3d& X_FB) {
  double largest = 0.0;
  for (int k = 0; k < 8; ++k) {
    const auto p = box.box_L.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
    largest = std::max(largest, (X_FA * p - X_FB * p).norm());
  }
  return largest;
}

bool has_unknown(const Braking& braking) {
  return std::any_of(braking.links.begin(), braking.links.end(),
                     [](const StoppingReach& link) { return link.distance == kInf; });
}

// The distance that is left is never more than any on the way: joints brake together, each may
// brake harder than is stated, and each may be ahead of the others.
TEST(StoppingReach, nothingOnTheWayIsNearer) {
  test::Rng rng(4711);
  int cases = 0, unknown = 0;
  double largest_share = 0.0;  // of its reach that a link used
  for (int i = 0; i < test::scaled(10000); ++i) {
    const Braking braking = random_braking(&rng);
    if (has_unknown(braking)) {
      ++unknown;
      continue;
    }
    const std::size_t count = braking.velocities.size();
    std::vector<double> here(braking.arm.size()), least(braking.arm.size(), kInf);
    const auto X_FB_here = braking.poses(std::vector<double>(count, 0.0));
    const auto X_FB_end = braking.poses(std::vector<double>(count, 1.0));
    for (int k = 0; k <= 20; ++k) {
      std::vector<double> shares(count, 0.1 * k);
      if (k > 10) {
        for (double& share : shares) share = test::uniform(&rng, 0.0, 1.0);
      }
      const auto X_FB = braking.poses(shares);
      for (std::size_t link = 0; link < braking.arm.size(); ++link) {
        const double distance = test::oracle_minimum(
            braking.arm.links[link], X_FB[braking.arm.bodies[link]], braking.motion.points);
        if (k == 0) here[link] = distance;
        least[link] = std::min(least[link], distance);
      }
    }
    for (std::size_t link = 0; link < braking.arm.size(); ++link) {
      const double reach = braking.links[link].distance;
      ASSERT_LE(here[link] - reach, least[link] + 1e-12) << "case " << i << ", link " << link;
      const std::size_t body = braking.arm.bodies[link];
      const double way = moved(braking.boxes[link], X_FB_here[body], X_FB_end[body]);
      ASSERT_LE(way, reach + 1e-12) << "case " << i << ", link " << link;
      if (reach > 0.01) largest_share = std::max(largest_share, way / reach);
      ++cases;
    }
  }
  EXPECT_GT(cases, test::scaled(10000));
  EXPECT_GT(unknown, test::scaled(200));  // those with a floating joint
  EXPECT_GT(largest_share, 0.9);
}

// Two joints that turn about z, the second one 1 m along x.
Kinematics two_joints() {
  RobotDescription description;
  description.root_link = "base";
  description.link_order = description.links_without_geometry = {"base", "a", "b"};
  description.joints = {
      test::joint("first", JointType::kRevolute, "base", "a", {0, 0, 0}, {0, 0, 1}),
      test::joint("second", JointType::kRevolute, "a", "b", {1, 0, 0}, {0, 0, 1})};
  return Kinematics(description);
}

// A link of 1 m at the second joint.
TEST(StoppingReach, ofAnArmByHand) {
  const Kinematics kinematics = two_joints();
  std::vector<Eigen::Isometry3d> X_FB(3, Eigen::Isometry3d::Identity());
  X_FB[2].translation().x() = 1.0;
  const Eigen::AlignedBox3d box(Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 0, 0));
  std::vector<StoppingReach> stops;
  brake_joints(kinematics, {2.0, -1.0}, {4.0, 0.5}, &stops);
  const StoppingReach reach = stopping_reach(kinematics, stops, 2, box, X_FB);
  EXPECT_NEAR(reach.speed, 2.0 * 2.0 + 1.0, 1e-8);           // 2 m and 1 m from the axes
  EXPECT_NEAR(reach.distance, 0.5 * 2.0 + 1.0 * 1.0, 1e-8);  // 0.5 rad, 1 rad
  EXPECT_NEAR(reach.time, 2.0, 1e-12);
  EXPECT_EQ(stopping_reach(kinematics, stops, 0, box, X_FB).distance, 0.0);
}

// The third joint mimics the second one, which mimics the first, and may be stated as well.
TEST(StoppingReach, ofAChainOfMimics) {
  RobotDescription description;
  description.root_link = "base";
  description.link_order = description.links_without_geometry = {"base", "a", "b", "c"};
  for (const auto& [name, child] : {std::pair("first", "a"), {"second", "b"}, {"third", "c"}}) {
    description.joints.push_back(
        test::joint(name, JointType::kRevolute, "base", child, {0, 0, 0}, {0, 0, 1}));
  }
  description.joints[1].mimic = Mimic{"first", -2.0, 0.0};
  description.joints[2].mimic = Mimic{"second", 3.0, 0.0};
  const Kinematics kinematics(description);
  std::vector<StoppingReach> stops;
  brake_joints(kinematics, {1.0, kNaN, kNaN}, {0.5, 0.0, 0.0}, &stops);
  EXPECT_EQ(stops[1].speed, 2.0);
  EXPECT_EQ(stops[2].speed, 6.0);
  EXPECT_EQ(stops[2].distance, 6.0);  // the first goes 1 rad
  brake_joints(kinematics, {1.0, 5.0, kNaN}, {0.5, 1.0, 0.0}, &stops);
  EXPECT_EQ(stops[2].speed, 15.0);
  EXPECT_EQ(stops[2].distance, 37.5);
}

// What is not known is not known to stand.
TEST(StoppingReach, ofUnknownJoints) {
  const Kinematics kinematics = two_joints();
  std::vector<StoppingReach> stops;
  const auto first = [&](double velocity, double deceleration) {
    brake_joints(kinematics, {velocity, 0.0}, {deceleration, 0.0}, &stops);
    return stops[0];
  };
  EXPECT_EQ(first(kNaN, 1.0).speed, kInf);
  EXPECT_EQ(first(kNaN, 1.0).distance, kInf);
  EXPECT_EQ(first(1.0, 0.0).distance, kInf);
  EXPECT_EQ(first(1.0, kNaN).distance, kInf);
  EXPECT_EQ(first(1.0, 0.0).speed, 1.0);
  EXPECT_EQ(first(kInf, 1.0).distance, kInf);
  EXPECT_EQ(first(0.0, 0.0).distance, 0.0);  // it stands
  for (const std::vector<double>& wrong : {std::vector<double>{}, std::vector<double>{1.0}}) {
    brake_joints(kinematics, wrong, {1.0, 1.0}, &stops);
    ASSERT_EQ(stops.size(), 2u);
    EXPECT_EQ(stops[0].distance, kInf);
    EXPECT_EQ(stops[1].distance, kInf);
  }
}

}  // namespace
}  // namespace ist
