#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"
#include "ros/common/eigen_conversion.h"
#include "ros/filter/command_message.h"
#include "support/control_robots.h"
#include "support/errors.h"

namespace ist {
namespace {

using Twist = Eigen::Matrix<double, 6, 1>;

constexpr double kNow = 1000.0;  // [s]
constexpr const char* kTool = "gripper_link";

geometry_msgs::TwistStamped message_of(const std::string& frame, const Twist& twist,
                                       double stamp = kNow) {
  geometry_msgs::TwistStamped message;
  message.header.frame_id = frame;
  message.header.stamp = ros::Time(stamp);
  assign(twist.head<3>(), &message.twist.linear);
  assign(twist.tail<3>(), &message.twist.angular);
  return message;
}

class TwistCommand : public ::testing::Test {
 protected:
  TwistCommand() : robot_(test::demo_control_robot()), q_(robot_.random_position(&rng_)) {
    reader_.q = [this](const std::string& name) { return position(q_, name); };
    reader_.kinematics = robot_.kinematics;
    reader_.tool = kTool;
    reader_.now = ros::Time(kNow);
    reader_.timeout = 0.1;
    for (const std::size_t j : robot_.joints) {
      reader_.joints.push_back(robot_.kinematics->joints()[j].name);
    }
  }

  double position(const Eigen::VectorXd& q, const std::string& name) const {
    for (std::size_t c = 0; c < robot_.joints.size(); ++c) {
      if (robot_.kinematics->joints()[robot_.joints[c]].name == name) {
        return q[static_cast<Eigen::Index>(c)];
      }
    }
    return std::numeric_limits<double>::quiet_NaN();
  }

  Eigen::Isometry3d pose(const Eigen::VectorXd& q, const std::string& body) const {
    std::vector<double> all;
    for (const Kinematics::Joint& joint : robot_.kinematics->joints()) {
      all.push_back(position(q, joint.name));
    }
    JointPoses joints;
    BodyPoses bodies;
    robot_.kinematics->place_joints(all, &joints);
    robot_.kinematics->place_bodies(joints, Eigen::Isometry3d::Identity(), &bodies);
    return bodies.X_FB[*robot_.kinematics->find_body(body)];
  }

  Eigen::VectorXd random_velocity() {
    std::normal_distribution<double> normal;
    return Eigen::VectorXd::NullaryExpr(q_.size(), [&] { return normal(rng_); });
  }

  // The tool's twist by central differences, in the axes of a body.
  Twist twist(const Eigen::VectorXd& velocity, const std::string& frame) const {
    const double h = 1e-5;
    const Eigen::Isometry3d before = pose(q_ - h * velocity, kTool);
    const Eigen::Isometry3d after = pose(q_ + h * velocity, kTool);
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(after.linear() * before.linear().transpose()));
    const Eigen::Matrix3d R_AF = pose(q_, frame).linear().transpose();
    Twist result;
    result << R_AF * (after.translation() - before.translation()),
        R_AF * (turn.angle() * turn.axis());
    return result / (2.0 * h);
  }

  void expect_fault(const geometry_msgs::TwistStamped& message, const std::string& text) const {
    const JointCommand command = read_command(message, reader_);
    test::expect_says(command.fault, text);
  }

  test::Rng rng_{7};
  test::ControlRobot robot_;
  Eigen::VectorXd q_;
  CommandReader reader_;
};

TEST_F(TwistCommand, IsWhatTheJointsMakeOfTheTool) {
  for (int k = 0; k < 200; ++k) {
    q_ = robot_.random_position(&rng_);
    for (const char* frame : {kTool, "base_link", "forearm_link"}) {
      const Twist wanted = twist(random_velocity(), frame);
      const JointCommand command = read_command(message_of(frame, wanted), reader_);
      if (!command.fault.empty()) {  // next to a singular pose
        test::expect_says(command.fault, "cannot move so");
        continue;
      }
      Eigen::VectorXd velocity = Eigen::VectorXd::Zero(q_.size());
      for (std::size_t i = 0; i < command.joints.size(); ++i) {
        for (std::size_t c = 0; c < reader_.joints.size(); ++c) {
          if (reader_.joints[c] != command.joints[i]) continue;
          velocity[static_cast<Eigen::Index>(c)] = command.velocity[i];
        }
      }
      EXPECT_LT((twist(velocity, frame) - wanted).norm(), 1e-5 * (1.0 + velocity.norm()));
      geometry_msgs::TwistStamped given = message_of(frame, Twist::Zero());
      set_velocity(command, command.velocity, reader_.q, &given);
      EXPECT_LT((to_vector(given.twist.linear) - wanted.head<3>()).norm(), 1e-5 * wanted.norm());
      EXPECT_LT((to_vector(given.twist.angular) - wanted.tail<3>()).norm(), 1e-5 * wanted.norm());
      // A joint that does not move the tool is not commanded.
      EXPECT_EQ(command.joints.size(), 6u);
    }
  }
}

TEST_F(TwistCommand, OfASingularPoseIsTheLeastVelocityOrNone) {
  for (std::size_t c = 0; c < reader_.joints.size(); ++c) {
    if (reader_.joints[c] == "wrist_pitch") q_[static_cast<Eigen::Index>(c)] = 0.0;
  }
  const Eigen::VectorXd some = random_velocity();
  const JointCommand command = read_command(message_of(kTool, twist(some, kTool)), reader_);
  ASSERT_EQ(command.fault, "");
  EXPECT_LT(Eigen::Map<const Eigen::VectorXd>(command.velocity.data(), 6).norm(), some.norm());
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(command.jacobian, Eigen::ComputeFullU);
  ASSERT_LT(svd.singularValues()[5], 1e-6);
  // Squares of a number may be more than a double holds, or less.
  for (const double size : {1.0, 1e-200, 1e200, 1e308}) {
    expect_fault(message_of(kTool, size * svd.matrixU().col(5)), "cannot move so");
  }
}

TEST_F(TwistCommand, ThatCannotBeUsedIsTold) {
  const Twist twist = Twist::Constant(0.1);
  for (int k = 0; k < 6; ++k) {
    for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
      Twist wrong = twist;
      wrong[k] = bad;
      expect_fault(message_of(kTool, wrong), "not a finite number");
    }
  }
  expect_fault(message_of("world", twist), "no link 'world'");
  expect_fault(message_of("", twist), "no link ''");
  expect_fault(message_of(kTool, twist, 0.0), "no stamp");
  expect_fault(message_of(kTool, twist, kNow - 0.2), "stamp is 0.20 s old");
  expect_fault(message_of(kTool, twist, kNow + 5.0), "ahead of the clock");
  reader_.tool = "tool";
  expect_fault(message_of(kTool, twist), "no link 'tool'");
  reader_.tool.clear();
  expect_fault(message_of("base_link", twist), "no joint moves 'base_link'");
  reader_.q = [](const std::string&) { return std::nan(""); };
  expect_fault(message_of(kTool, twist), "does not follow from the joint states");
}

// A base that slides along x and y, and turns.
TEST(BaseCommand, IsOfTheBaseInItsOwnAxes) {
  std::string urdf = "<robot name='base'><link name='odom'/>";
  std::string parent = "odom";
  for (const auto& [joint, type, axis] :
       {std::array{"x", "prismatic", "1 0 0"}, std::array{"y", "prismatic", "0 1 0"},
        std::array{"turn", "continuous", "0 0 1"}}) {
    const std::string link = std::string("after_") + joint;
    urdf += "<link name='" + link + "'/><joint name='" + joint + "' type='" + type +
            "'><parent link='" + parent + "'/><child link='" + link + "'/><axis xyz='" + axis +
            "'/><limit lower='-9' upper='9' velocity='1' effort='1'/></joint>";
    parent = link;
  }
  const auto no_packages = [](const std::string&) { return std::string(); };
  CommandReader reader;
  reader.joints = {"x", "y", "turn"};
  reader.q = [](const std::string& joint) { return joint == "turn" ? 1.1 : 2.0; };
  reader.kinematics = std::make_shared<const Kinematics>(
      parse_urdf(urdf + "</robot>", GeometrySource::kCollision, no_packages));
  reader.tool = "after_turn";
  reader.now = ros::Time(kNow);
  reader.timeout = 0.1;
  geometry_msgs::Twist message;
  message.linear.x = 0.4;
  message.linear.y = 0.1;
  message.angular.z = 0.3;
  const JointCommand command = read_command(message, reader);
  ASSERT_EQ(command.fault, "");
  EXPECT_TRUE(command.keeps_way);
  EXPECT_EQ(command.joints, reader.joints);
  EXPECT_NEAR(command.velocity[0], 0.4 * std::cos(1.1) - 0.1 * std::sin(1.1), 1e-12);
  EXPECT_NEAR(command.velocity[1], 0.4 * std::sin(1.1) + 0.1 * std::cos(1.1), 1e-12);
  EXPECT_NEAR(command.velocity[2], 0.3, 1e-12);
  std::vector<double> half = command.velocity;
  for (double& v : half) v *= 0.5;
  set_velocity(command, half, reader.q, &message);
  EXPECT_NEAR(message.linear.x, 0.2, 1e-12);
  EXPECT_NEAR(message.linear.y, 0.05, 1e-12);
  EXPECT_NEAR(message.angular.z, 0.15, 1e-12);
  message.linear.z = 0.1;
  test::expect_says(read_command(message, reader).fault, "cannot move so");
}

// Positions alone: a joint without limits turns the shorter way round.
TEST(PositionCommand, GoesTheShorterWay) {
  const std::string urdf =
      "<robot name='r'><link name='base'/><link name='a'/><link name='b'/><joint name='round' "
      "type='continuous'><parent link='base'/><child link='a'/></joint><joint name='slide' "
      "type='prismatic'><parent link='a'/><child link='b'/><limit lower='-9' upper='9' "
      "velocity='1' effort='1'/></joint></robot>";
  CommandReader reader;
  reader.q = [](const std::string& /*joint*/) { return -3.0; };
  reader.kinematics = std::make_shared<const Kinematics>(
      parse_urdf(urdf, GeometrySource::kCollision, [](const std::string&) { return ""; }));
  trajectory_msgs::JointTrajectory message;
  message.joint_names = {"round", "slide"};
  message.points.resize(1);
  message.points[0].positions = {3.0, 3.0};
  message.points[0].time_from_start = ros::Duration(2.0);
  const JointCommand command = read_command(message, reader);
  ASSERT_EQ(command.fault, "");
  EXPECT_NEAR(command.velocity[0], 0.5 * (6.0 - 2.0 * EIGEN_PI), 1e-12);
  EXPECT_NEAR(command.velocity[1], 3.0, 1e-12);
}

}  // namespace
}  // namespace ist
