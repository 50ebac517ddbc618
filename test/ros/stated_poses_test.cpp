// A robot and obstacles on it whose newest poses are of several instants, or come between lookups.

#include "ros/poses/stated_pose_source.h"

#include <gtest/gtest.h>
#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ros/cycle/proximity_cycle.h"
#include "support/cycle_parts.h"
#include "support/scene.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

constexpr double kReach = 0.5, kGap = 0.4;  // [m] from a link's frame to the point, and its surface
constexpr double kOften = 0.02, kSeldom = 0.25;     // [s] between two transforms
constexpr double kEnd = 102.2, kNow = kEnd + 1e-3;  // [s] until when transforms have come
constexpr char kBall[] =
    "<collision><geometry><sphere radius='0.1'/></geometry></collision></link>";

/// A point in a frame that is looked up with the snapshot.
class TraySource : public test::StatedSource {
 public:
  explicit TraySource(const TransformBuffer& buffer) : StatedSource("camera"), buffer_(buffer) {}

  std::shared_ptr<const SourceSnapshot> share(const SnapshotRequest& request) override {
    if (before) before();
    Eigen::Isometry3d X_FT = Eigen::Isometry3d::Identity();
    EXPECT_EQ(look_up_for(request, buffer_, "odom", frame, &X_FT, &lags_), "");
    if (after) after();
    *cloud(request.time) = test::make_snapshot({X_FT * Eigen::Vector3d(kReach, 0.0, 0.0)});
    set_lags(lags_);
    return StatedSource::share(request);
  }

  std::string frame = "tray";
  std::function<void()> before, after;  ///< called around the lookup; may be empty

 private:
  const TransformBuffer& buffer_;
  std::array<Lag, 2> lags_;
};

/// A robot that drives, and an obstacle that stays kGap from it.
class StatedPosesTest : public ::testing::Test {
 protected:
  StatedPosesTest() {
    ros::Time::init();
    auto source = std::make_unique<TraySource>(buffer_);
    tray_ = source.get();
    sources_.push_back(std::move(source));
    live_.query.deadline = 0.0;
    config_.fixed_frame = "odom";
  }

  void tell(const std::string& parent, const std::string& child, double speed, double stamp,
            bool is_static = false) {
    geometry_msgs::TransformStamped X;
    X.header.stamp = ros::Time(stamp);
    const double yaw = child == "base" ? turn_ * (stamp - 100.0) : 0.0;
    X.transform.rotation.z = std::sin(0.5 * yaw);
    X.transform.rotation.w = std::cos(0.5 * yaw);
    X.header.frame_id = parent;
    X.child_frame_id = child;
    X.transform.translation.x = speed * (stamp - 100.0) + (parent == "odom" ? start_ : 0.0);
    EXPECT_EQ(buffer_.add(X, "/robot", is_static, ros::Time(stamp)), "");
  }
  // A frame that moves at a steady speed [m/s] until the end.
  void move(const std::string& parent, const std::string& child, double speed, double period) {
    for (double stamp = 100.0; stamp < kEnd - 0.01; stamp += period)
      tell(parent, child, speed, stamp);
  }

  // The answer just after the end to a robot with one ball.
  ist_proximity::LinkProximity ask(const std::string& urdf) {
    const RobotDescription description =
        parse_urdf(urdf, GeometrySource::kCollision, [](const std::string&) { return ""; });
    const auto robot = build_robot_model(description, RobotModelConfig());
    auto poses = std::make_unique<StatedPoseSource>(std::make_shared<const Kinematics>(description),
                                                    buffer_, "odom", link_names(*robot), 1.0, 0.01,
                                                    StatedPoseSource::Stamp::kNow);
    EXPECT_EQ(poses->state({}), "");
    tray_->set_model(robot, "odom", RegionOfInterest());
    ProximityCycle cycle(test::ready_model(robot), config_, std::move(poses),
                         CloudSelection::Reader::kOther);
    ProximityArray message;
    cycle.run(ros::Time(kNow), sources_, live_, "", &message);
    EXPECT_EQ(message.links.at(0).state, message.links.at(0).NEAR) << message.status_text;
    return message.links.at(0);
  }

  const std::string base_ =
      std::string("<robot name='ball'><link name='base'>") + kBall + "</robot>";
  const std::string lift_ =
      std::string("<robot name='ball'><link name='base'/><link name='lift'>") + kBall +
      "<joint name='j' type='prismatic'><parent link='base'/><child link='lift'/>"
      "<axis xyz='1 0 0'/><limit lower='-5' upper='5' effort='1' velocity='1'/></joint></robot>";
  double start_ = 0.0, turn_ = 0.0;  // [m] of frames in odom, [rad/s] of the base
  TransformBuffer buffer_{ros::Duration(10.0)};
  TraySource* tray_ = nullptr;
  CloudSources sources_;
  ServerConfig config_;
  LiveConfig live_;
};

// A tray that was newer than the base was farther away than it is.
TEST_F(StatedPosesTest, ATrayIsNotNewerThanTheBaseThatCarriesIt) {
  for (const double speed : {0.3, -0.3}) {
    for (const bool is_before : {true, false}) {
      buffer_.clear();
      move("base", "tray", 0.0, kOften);
      move("odom", "base", speed, kOften);
      tray_->before = tray_->after = nullptr;
      (is_before ? tray_->before : tray_->after) = [&] {
        tell("base", "tray", 0.0, kEnd);
        tell("odom", "base", speed, kEnd);
      };
      const double bound = ask(base_).lower_bound;
      EXPECT_LE(bound, kGap + 1e-6) << speed << " m/s, before " << is_before;
      EXPECT_GT(bound, kGap - 0.02) << speed << " m/s, before " << is_before;
    }
  }
}

// What the base stands on is told often, and where on it seldom.
TEST_F(StatedPosesTest, WhatCarriesTheBaseIsNotNewerThanTheBase) {
  for (const double speed : {0.3, -0.3}) {
    buffer_.clear();
    move("odom", "tray", speed, kOften);
    move("tray", "base", 0.0, kSeldom);
    const double bound = ask(base_).lower_bound;
    EXPECT_LE(bound, kGap + 1e-6) << speed << " m/s";
    EXPECT_GT(bound, kGap - 1.1 * 0.3 * kSeldom) << speed << " m/s";
  }
}

// An obstacle that is told seldom stands while the robot makes a step towards it.
TEST_F(StatedPosesTest, AnObstacleThatStandsIsNotTakenAlong) {
  move("odom", "tray", 0.0, kSeldom);
  for (double stamp = 100.0; stamp < kEnd; stamp += kOften) {
    tell("odom", "base", stamp < 102.1 ? 0.0 : 0.1 / (stamp - 100.0), stamp);
  }
  EXPECT_NEAR(ask(base_).lower_bound, kGap - 0.1, 1e-4);
}

// How far robot and obstacle have come towards each other since is taken off.
TEST_F(StatedPosesTest, AnObstacleThatComesIsLate) {
  move("odom", "base", 0.1, kOften);
  move("odom", "tray", -0.05, kSeldom);
  const double gap = kGap - 0.15 * (kNow - 100.0), bound = ask(base_).lower_bound;
  EXPECT_LE(bound, gap + 1e-6);
  EXPECT_GT(bound, gap - 0.01);
}

// Far from where the fixed frame begins, a robot that turns about itself comes nearer to nothing.
TEST_F(StatedPosesTest, AnObstacleIsLateByItsMotionWhereTheRobotIs) {
  start_ = 5.0;
  turn_ = 0.5;
  move("odom", "base", 0.0, kOften);
  move("odom", "tray", 0.0, kSeldom);
  const double bound = ask(base_).lower_bound;
  EXPECT_LE(bound, kGap + 1e-6);
  EXPECT_GT(bound, kGap - 0.1);
}

// A cloud was accepted where the robot's base was; then the base is somewhere else all the time.
TEST_F(StatedPosesTest, ABaseThatIsCalibratedIsNotNewerThanTheCloud) {
  tell("odom", "base", 0.0, kEnd, true);
  tray_->frame = "odom";
  tray_->after = [&] { tell("odom", "base", -0.3, kEnd, true); };
  EXPECT_NEAR(ask(base_).lower_bound, kGap, 1e-4);
}

// A joint that is told seldom moves against the base that drives: its link and a tray on it stand.
TEST_F(StatedPosesTest, ATrayIsNotNewerThanTheLinkThatCarriesIt) {
  for (const double speed : {0.3, -0.3}) {
    for (const bool is_told : {false, true}) {
      buffer_.clear();
      move("odom", "base", -speed, kOften);
      move("base", "lift", speed, kSeldom);
      move("lift", "tray", 0.0, kOften);
      tray_->before = tray_->after = nullptr;
      if (is_told) tray_->before = [&] { tell("base", "lift", speed, kEnd); };
      const double bound = ask(lift_).lower_bound;
      EXPECT_LE(bound, kGap + 1e-6) << speed << " m/s, told " << is_told;
      EXPECT_GT(bound, kGap - 2.0 * 0.3 * kSeldom) << speed << " m/s, told " << is_told;
    }
  }
}

}  // namespace
}  // namespace ist
