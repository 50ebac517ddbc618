#include "ros/filter/joint_history.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"
#include "support/errors.h"

namespace ist {
namespace {

constexpr const char* kGripper = R"(<robot name="gripper">
  <link name="palm"/><link name="left"/><link name="right"/>
  <joint name="left" type="prismatic"><parent link="palm"/><child link="left"/>
    <limit lower="0" upper="1" velocity="1" effort="1"/></joint>
  <joint name="right" type="prismatic"><parent link="palm"/><child link="right"/>
    <limit lower="0" upper="1" velocity="1" effort="1"/><mimic joint="left"/></joint>
</robot>)";

class JointHistoryTest : public ::testing::Test {
 protected:
  JointHistoryTest()
      : kinematics_(std::make_shared<const Kinematics>(parse_urdf(
            kGripper, GeometrySource::kCollision, [](const std::string&) { return ""; }))),
        history_(kinematics_) {}

  void add(const std::string& joint, double q, double stamp, double now) {
    sensor_msgs::JointState message;
    message.header.stamp = ros::Time(stamp);
    message.name = {joint};
    message.position = {q};
    history_.add(message, ros::Time(now));
  }

  std::shared_ptr<const Kinematics> kinematics_;
  JointHistory history_;
  const std::size_t left_ = 0;
};

TEST_F(JointHistoryTest, MeasuresVelocityUpToTheNewestPosition) {
  add("left", 0.0, 10.0, 10.0);
  EXPECT_TRUE(std::isnan(history_.velocity(left_, 0.05)));
  for (int k = 1; k <= 20; ++k) add("left", 0.003 * k, 10.0 + 0.01 * k, 10.0 + 0.01 * k);
  EXPECT_NEAR(history_.velocity(left_, 0.05), 0.3, 1e-6);
  // Seldom ones: from the last but one.
  add("left", 0.09, 10.3, 10.3);
  EXPECT_NEAR(history_.velocity(left_, 0.05), 0.3, 1e-6);
}

// The node does not use a joint that a message states at two places either.
TEST_F(JointHistoryTest, APlaceThatIsStatedTwiceIsNone) {
  add("left", 0.1, 10.0, 10.0);
  sensor_msgs::JointState message;
  message.header.stamp = ros::Time(10.1);
  message.name = {"left", "left", "left"};
  message.position = {0.2, 0.3, 0.3};
  history_.add(message, ros::Time(10.1));
  EXPECT_EQ(history_.newest(left_), 0.1);
  message.position = {0.2, 0.2, 0.2};
  history_.add(message, ros::Time(10.1));
  EXPECT_EQ(history_.newest(left_), 0.2);
}

// Joints that are stated apart, one of them seldom: each has its own times.
TEST_F(JointHistoryTest, StatesOfOthersAreNoneOfAJoint) {
  const auto place = [](double t) { return 0.3 + 0.2 * t; };  // of "left", at 12.5 Hz
  std::vector<double> q;
  add("right", 0.0, 10.01, 10.01);
  add("left", place(0.04), 10.04, 10.04);
  EXPECT_FALSE(history_.at(ros::Time(10.02), &q)) << "\"left\" was stated later";
  for (int k = 2; k <= 50; ++k) {
    const double t = 0.01 * k;
    add("right", 0.0, 10.0 + t, 10.0 + t);
    if (k % 8 == 4) add("left", place(t), 10.0 + t, 10.0 + t);
  }
  for (double t = 0.05; t < 0.44; t += 0.013) {
    ASSERT_TRUE(history_.at(ros::Time(10.0 + t), &q));
    EXPECT_NEAR(q[left_], place(t), 1e-6) << t;
  }
  EXPECT_NEAR(history_.velocity(left_, 0.05), 0.2, 1e-6);
}

// A node holds a joint that is stated apart, perhaps at a sample before its last one.
TEST_F(JointHistoryTest, MovedSinceTheSamplesThatANodeMayHold) {
  for (int k = 0; k <= 4; ++k) add("left", 0.1 * k * k, 10.0 + 0.1 * k, 10.0 + 0.1 * k);
  std::vector<double> q, moved;
  ASSERT_TRUE(history_.at(ros::Time(10.36), &q, &moved));
  EXPECT_NEAR(q[left_], 1.32, 1e-6);
  EXPECT_NEAR(moved[left_], 1.2, 1e-6);
  ASSERT_TRUE(history_.at(ros::Time(10.3), &q, &moved));
  EXPECT_NEAR(moved[left_], 0.7, 1e-6);
  ASSERT_TRUE(history_.at(ros::Time(10.46), &q, &moved));
  EXPECT_NEAR(moved[left_], 0.7, 1e-6);
  ASSERT_TRUE(history_.at(ros::Time(10.44), &q, &moved));  // the newest may have come later
  EXPECT_NEAR(moved[left_], 1.2, 1e-6);
  EXPECT_TRUE(std::isnan(moved[1]));
  add("right", 0.0, 10.3, 10.4);  // another message of the same stamp
  ASSERT_TRUE(history_.at(ros::Time(10.3), &q, &moved));
  EXPECT_NEAR(moved[left_], 1.5, 1e-6);
}

// A simulated clock has steps: a node has answered for the first state of one.
TEST_F(JointHistoryTest, MovedSinceTheFirstOfOneStamp) {
  add("left", 0.0, 10.0, 10.0);
  for (int k = 1; k <= 50; ++k) add("left", 0.1 * k, 10.1, 10.1);
  std::vector<double> q, moved;
  ASSERT_TRUE(history_.at(ros::Time(10.1), &q, &moved));
  EXPECT_EQ(q[left_], 0.1);
  EXPECT_NEAR(moved[left_], 4.9, 1e-9);
  EXPECT_EQ(history_.newest(left_), 5.0);
}

// Mimic joints are needed once they are stated.
TEST_F(JointHistoryTest, AgesOfMimicJoints) {
  add("left", 0.0, 10.0, 10.0);
  EXPECT_NEAR(history_.age(ros::Time(10.1)), 0.1, 1e-6);
  add("right", 0.0, 10.0, 10.0);
  add("left", 0.0, 10.3, 10.3);
  EXPECT_NEAR(history_.age(ros::Time(10.4)), 0.4, 1e-6);
}

TEST_F(JointHistoryTest, TakesStampsThatAreAheadForPresentOnes) {
  add("left", 0.1, 10.8, 10.0);
  add("left", 0.2, 10.9, 10.1);
  std::vector<double> q;
  ASSERT_TRUE(history_.at(ros::Time(10.1), &q));
  EXPECT_EQ(q[left_], 0.2);
  EXPECT_NE(history_.late_joint(ros::Time(10.3), 0.1), "");
}

// A node that reads tf has positions where their stamps are, also those of a clock that is ahead.
TEST_F(JointHistoryTest, MovedSinceStampsThatAreAhead) {
  std::vector<double> q, moved;
  for (int k = 0; k <= 80; ++k) {
    const double now = 10.0 + 0.01 * k;
    add("left", 0.005 * k, now + 0.4, now);
    const bool is_known = history_.at(ros::Time(now), &q, &moved);
    EXPECT_EQ(is_known, k >= 40) << "what was sent now came 0.4 s ago";
  }
  ASSERT_TRUE(history_.at(ros::Time(10.8), &q, &moved));
  EXPECT_NEAR(q[left_], 0.4, 1e-6);
  EXPECT_NEAR(moved[left_], 0.2, 1e-6) << "of a node that reads tf, 0.4 s ago";
}

// A clock that is ahead by about what is taken for exact: no position waits for the next ones.
TEST_F(JointHistoryTest, TakesEveryPositionOfAClockThatIsALittleAhead) {
  add("left", 0.1, 10.0099, 10.0);
  add("left", 0.2, 10.0121, 10.002);
  EXPECT_EQ(history_.newest(left_), 0.2);
  add("left", 0.3, 10.0145, 10.004);
  EXPECT_EQ(history_.newest(left_), 0.3);
  add("left", 0.4, 10.0125, 10.0125);
  EXPECT_EQ(history_.newest(left_), 0.4) << "of a publisher whose clock is right";
}

TEST_F(JointHistoryTest, TellsOfMimicJointsThatAreNoLongerStated) {
  add("left", 0.1, 10.0, 10.0);
  EXPECT_EQ(history_.late_joint(ros::Time(10.0), 0.1), "");
  add("right", 0.1, 10.0, 10.0);
  add("left", 0.2, 11.0, 11.0);
  test::expect_says(history_.late_joint(ros::Time(11.0), 0.1), "'right'");
}

}  // namespace
}  // namespace ist
