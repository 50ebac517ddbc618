#include "ist_proximity/robot/kinematics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "support/random_robots.h"

namespace ist {
namespace {

std::vector<Eigen::Isometry3d> place(const Kinematics& k, const std::vector<double>& q,
                                     const Eigen::Isometry3d& X_FR) {
  JointPoses joints;
  k.place_joints(q, &joints);
  // Planar and floating joints are at their origin.
  for (std::size_t j = 0; j < joints.known.size(); ++j) {
    if (!k.joints()[j].has_unstated_pose()) continue;
    joints.X_PC[j] = k.joints()[j].X_PJ;
    joints.known[j] = true;
  }
  BodyPoses bodies;
  k.place_bodies(joints, X_FR, &bodies);
  return bodies.X_FB;
}

// Velocity of a body's point and of its frame, by central differences of the kinematics.
Eigen::Matrix<double, 6, 1> difference(const Kinematics& k, std::vector<double> q, std::size_t j,
                                       const Eigen::Isometry3d& X_FR, std::size_t body,
                                       const Eigen::Vector3d& p_B) {
  constexpr double kStep = 1e-5;
  q[j] += kStep;
  const Eigen::Isometry3d after = place(k, q, X_FR)[body];
  q[j] -= 2 * kStep;
  const Eigen::Isometry3d before = place(k, q, X_FR)[body];
  const Eigen::AngleAxisd turn(after.linear() * before.linear().transpose());
  Eigen::Matrix<double, 6, 1> velocity;
  velocity << after * p_B - before * p_B, turn.angle() * turn.axis();
  return velocity / (2 * kStep);
}

TEST(Jacobian, randomRobotsAgainstFiniteDifferences) {
  test::Rng rng(61);
  Jacobian J;
  for (int trial = 0; trial < 60; ++trial) {
    RobotDescription robot = test::random_robot(&rng, 12);
    if (trial % 3 == 0) robot.joints[0].type = JointType::kFloating;
    if (trial % 3 == 0) robot.joints[0].mimic.reset();
    for (JointDescription& joint : robot.joints) {
      if (joint.mimic && joint.mimic->joint == "j1" && trial % 3 == 0) joint.mimic.reset();
    }
    const Kinematics k(robot);
    std::vector<double> q;
    for (const Kinematics::Joint& joint : k.joints()) {
      q.push_back(joint.is_free() ? test::uniform(&rng, -2, 2) : std::nan(""));
    }
    const Eigen::Isometry3d X_FR = test::random_pose(&rng, 1.0);
    const auto X_FB = place(k, q, X_FR);
    for (std::size_t body = 0; body < k.bodies().size(); ++body) {
      const Eigen::Vector3d p_B = test::random_vector(&rng, 1.0);
      point_jacobian(k, X_FB, body, X_FB[body] * p_B, &J);
      ASSERT_EQ(J.cols(), static_cast<Eigen::Index>(k.joints().size()));
      for (std::size_t j = 0; j < k.joints().size(); ++j) {
        const auto column = J.col(static_cast<Eigen::Index>(j));
        if (!k.joints()[j].is_free()) {
          EXPECT_TRUE(column.isZero(0.0));
          continue;
        }
        EXPECT_LT((column - difference(k, q, j, X_FR, body, p_B)).cwiseAbs().maxCoeff(), 1e-7)
            << "trial " << trial << ", joint " << j << ", body " << body;
      }
    }
  }
}

TEST(Jacobian, namesTheBodyWhosePoseItNeeds) {
  RobotDescription robot;
  robot.root_link = "l0";
  const JointType types[] = {JointType::kRevolute, JointType::kFloating, JointType::kPrismatic,
                             JointType::kFixed};
  for (int i = 0; i < 4; ++i) {
    const std::string n = std::to_string(i);
    robot.joints.push_back(test::joint("j" + n, types[i], "l" + n, "l" + std::to_string(i + 1)));
  }
  const Kinematics k(robot);
  std::vector<bool> known(5, true);
  EXPECT_FALSE(first_body_needed(k, known, 4).has_value());
  known[0] = known[2] = false;  // the root, and the child of the floating joint: neither is read
  EXPECT_FALSE(first_body_needed(k, known, 4).has_value());
  EXPECT_EQ(first_body_needed(k, known, 2), 2U) << "the body itself";
  known[1] = false;
  EXPECT_EQ(first_body_needed(k, known, 4), 1U);
  known[3] = known[4] = false;
  EXPECT_EQ(first_body_needed(k, known, 4), 4U);

  // Poses that are not needed are not read.
  auto X_FB = place(k, {0.3, 0.0, 0.1, 0.0}, Eigen::Isometry3d::Identity());
  Jacobian all, some;
  point_jacobian(k, X_FB, 4, X_FB[4].translation(), &all);
  X_FB[0].matrix().setConstant(std::numeric_limits<double>::quiet_NaN());
  X_FB[2].matrix().setConstant(std::numeric_limits<double>::quiet_NaN());
  point_jacobian(k, X_FB, 4, X_FB[4].translation(), &some);
  EXPECT_EQ(all, some);
}

}  // namespace
}  // namespace ist
