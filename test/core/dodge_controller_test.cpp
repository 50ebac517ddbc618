#include "dodge_controller.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "ist_proximity/robot/kinematics.h"
#include "support/demo_arm.h"
#include "support/scene.h"

namespace ist::example {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class DodgeController : public ::testing::Test {
 protected:
  DodgeController()
      : arm(test::demo_robot(), {"shoulder_yaw", "shoulder_pitch", "elbow_pitch", "forearm_roll",
                                 "wrist_pitch", "wrist_roll"}) {
    q.assign(arm.kinematics.joints().size(), 0.0);
    set({0.1, 0.4, 1.0, 0.2, 0.3, -0.2});
    goal = commanded();
    reading.is_ok = true;
    reading.message_age = 0.005;
    reading.cloud_age = 0.1;
    reading.speed_scale = 1.0;
    reading.links.push_back(clear());
  }

  void set(const std::vector<double>& positions) {
    for (std::size_t j = 0; j < positions.size(); ++j) q[arm.joints[j]] = positions[j];
  }
  Eigen::VectorXd commanded() const {
    Eigen::VectorXd positions(static_cast<Eigen::Index>(arm.joints.size()));
    for (std::size_t j = 0; j < arm.joints.size(); ++j) {
      positions[static_cast<Eigen::Index>(j)] = q[arm.joints[j]];
    }
    return positions;
  }
  LinkReading clear() const {
    LinkReading link;
    link.body = *arm.kinematics.find_body("gripper_link");
    link.lower_bound = 1.0;
    link.p_LCl.setConstant(kNan);
    return link;
  }
  LinkReading near(double bound, const Eigen::Vector3d& away) const {
    LinkReading link = clear();
    link.lower_bound = bound;
    link.p_LCl = {0.0, 0.01, 0.05};
    link.away = away;
    return link;
  }
  // [m/s] How fast a command moves the witness along n.
  double speed_along(const LinkReading& link, const Eigen::VectorXd& dq) const {
    JointPoses poses;
    BodyPoses bodies;
    arm.kinematics.place_joints(q, &poses);
    arm.kinematics.place_bodies(poses, Eigen::Isometry3d::Identity(), &bodies);
    Jacobian J;
    point_jacobian(arm.kinematics, bodies.X_FB, link.body, bodies.X_FB[link.body] * link.p_LCl, &J);
    double speed = 0.0;
    for (std::size_t j = 0; j < arm.joints.size(); ++j) {
      speed +=
          dq[static_cast<Eigen::Index>(j)] *
          J.col(static_cast<Eigen::Index>(arm.joints[j])).head<3>().dot(link.away.normalized());
    }
    return speed;
  }
  Eigen::VectorXd run() const { return dodge(arm, q, goal, reading, config); }

  ControlledArm arm;
  std::vector<double> q;
  Eigen::VectorXd goal;
  Reading reading;
  DodgeConfig config;
};

TEST_F(DodgeController, GoesToTheGoalWhereNothingIsNear) {
  goal[0] += 1.0;
  goal[2] -= 0.5;
  const Eigen::VectorXd dq = run();
  EXPECT_NEAR(dq[0], config.task_speed, 1e-9);
  EXPECT_NEAR(dq[2], -0.5 * config.task_speed, 1e-9);
  EXPECT_NEAR(dq[1], 0.0, 1e-9);
  EXPECT_FALSE(has_reached(arm, q, goal, config));
  goal = commanded();
  EXPECT_TRUE(has_reached(arm, q, goal, config));
  EXPECT_NEAR(run().norm(), 0.0, 1e-9);
}

TEST_F(DodgeController, StopsWhenTheSurroundingsAreNotKnown) {
  goal[0] += 1.0;
  const Reading good = reading;
  ASSERT_GT(run().norm(), 0.1);
  const auto expect_stop = [this, &good](const char* why) {
    EXPECT_FALSE(is_known(reading, config)) << why;
    EXPECT_EQ(run().norm(), 0.0) << why;
    reading = good;
  };
  reading.is_ok = false;
  expect_stop("status");
  reading.message_age = config.max_message_age + 0.01;
  expect_stop("old message");
  reading.cloud_age = config.max_cloud_age + 0.01;
  expect_stop("old cloud");
  reading.cloud_age = kNan;
  expect_stop("no cloud");
  reading.links.clear();
  expect_stop("no link");
  reading.links.push_back(near(-std::numeric_limits<double>::infinity(), {0.0, 0.0, 1.0}));
  expect_stop("a link is UNKNOWN");
  q[arm.joints[3]] = kNan;
  EXPECT_EQ(run().norm(), 0.0) << "a joint is not known";
}

TEST_F(DodgeController, StepsAside) {
  reading.links = {near(0.06, {0.0, 0.0, 0.3})};
  const Eigen::VectorXd dq = run();
  const double wanted = config.damping * (config.keep_distance - 0.06);
  EXPECT_GT(speed_along(reading.links[0], dq), 0.8 * wanted);  // the constraint is soft
  EXPECT_LE(speed_along(reading.links[0], dq), wanted + 1e-9);
  // The length of `away` does not matter.
  reading.links[0].away *= 0.01;
  EXPECT_NEAR((run() - dq).norm(), 0.0, 1e-9);
}

TEST_F(DodgeController, TheSpeedScaleSlowsTheTaskAndNotTheEvasion) {
  goal[5] += 1.0;
  for (const double scale : {0.0, 0.3, 1.0}) {
    reading.speed_scale = scale;
    EXPECT_NEAR(run()[5], scale * config.task_speed, 1e-9);
  }
  for (const double wrong : {kNan, -1.0, 7.0}) {
    reading.speed_scale = wrong;
    EXPECT_NEAR(run()[5], wrong > 0.0 ? config.task_speed : 0.0, 1e-9) << wrong;
  }
  reading.speed_scale = 0.0;
  reading.links = {near(0.06, {0.0, 0.0, 0.3})};
  EXPECT_GT(speed_along(reading.links[0], run()), 0.3);
}

TEST_F(DodgeController, LinksThatCannotMoveDoNotCount) {
  goal[0] += 1.0;
  LinkReading base = near(0.0, {0.0, 0.0, 1.0});
  base.body = *arm.kinematics.find_body("base_link");
  const Eigen::VectorXd undisturbed = run();
  reading.links.push_back(base);
  EXPECT_NEAR((run() - undisturbed).norm(), 0.0, 1e-12);
}

// Joints keep their limits with any reading, and a small change of a reading changes the command
// little.
TEST_F(DodgeController, KeepsLimitsAndIsContinuous) {
  test::Rng rng(2);
  for (int i = 0; i < 500; ++i) {
    reading.links.clear();
    std::vector<double> positions;
    for (const std::size_t j : arm.joints) {
      const auto& joint = arm.kinematics.joints()[j];
      positions.push_back(test::uniform(&rng, joint.lower, joint.upper));
    }
    set(positions);
    goal = commanded() + Eigen::VectorXd::Random(6);
    for (const char* name : {"upper_arm_link", "forearm_link", "wrist_link", "gripper_link"}) {
      LinkReading link = near(test::uniform(&rng, -0.02, 0.4), test::random_vector(&rng, 1.0));
      link.body = *arm.kinematics.find_body(name);
      link.p_LCl = test::random_vector(&rng, 0.1);
      reading.links.push_back(link);
    }
    const Eigen::VectorXd dq = run();
    ASSERT_TRUE(dq.allFinite());
    for (std::size_t j = 0; j < arm.joints.size(); ++j) {
      const auto& joint = arm.kinematics.joints()[arm.joints[j]];
      const double v = dq[static_cast<Eigen::Index>(j)];
      // The method converges to the limits; an error of 2 % remains after its sweeps.
      EXPECT_LE(std::abs(v), 1.02 * config.max_joint_speed);
      EXPECT_LE(v, config.limit_gain * (joint.upper - positions[j]) + 0.02);
      EXPECT_GE(v, -config.limit_gain * (positions[j] - joint.lower) - 0.02);
    }
    for (LinkReading& link : reading.links) {
      link.lower_bound += 1e-5;
      link.away += 1e-5 * link.away.norm() * Eigen::Vector3d::UnitX();
    }
    EXPECT_LT((run() - dq).norm(), 0.01);
  }
}

TEST_F(DodgeController, NamesAJointThatIsNotThere) {
  try {
    ControlledArm(test::demo_robot(), {"elbow_pitch", "no_such_joint"});
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("no_such_joint"), std::string::npos);
  }
}

}  // namespace
}  // namespace ist::example
