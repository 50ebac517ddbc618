// Transforms that come between the lookups of a robot's base and of the obstacles on it.

#include "ros/poses/stated_pose_source.h"

#include <gtest/gtest.h>
#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ros/cycle/proximity_cycle.h"
#include "ros/poses/transforms.h"
#include "support/cycle_parts.h"
#include "support/scene.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

constexpr double kRadius = 0.1, kReach = 0.5;  // [m] of the robot, and to the point on its tray
constexpr double kPeriod = 0.02;               // [s] between two transforms
constexpr char kUrdf[] =
    "<robot name='ball'><link name='base'><collision><geometry><sphere radius='0.1'/></geometry>"
    "</collision></link></robot>";

/// A point in the frame "tray", which is looked up with the snapshot.
class TraySource : public test::StatedSource {
 public:
  explicit TraySource(const TransformBuffer& buffer) : StatedSource("camera"), buffer_(buffer) {}

  std::shared_ptr<const SourceSnapshot> share(const SnapshotRequest& request) override {
    if (before) before();
    Eigen::Isometry3d X_FT = Eigen::Isometry3d::Identity();
    EXPECT_EQ(look_up_near(buffer_, "odom", "tray", request.time, request.max_age, &X_FT, &lag_),
              "");
    if (after) after();
    *cloud(request.time) = test::make_snapshot({X_FT * Eigen::Vector3d(kReach, 0.0, 0.0)});
    set_lag(lag_);
    return StatedSource::share(request);
  }

  std::function<void()> before, after;  ///< called around the lookup; may be empty

 private:
  const TransformBuffer& buffer_;
  Lag lag_;
};

/// A robot whose base drives, and carries a tray.
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

  void tell(double speed, double stamp) {
    geometry_msgs::TransformStamped X;
    X.header.stamp = ros::Time(stamp);
    X.transform.rotation.w = 1.0;
    X.header.frame_id = "base";
    X.child_frame_id = "tray";
    EXPECT_EQ(buffer_.add(X, "/base", false, ros::Time(stamp)), "");
    X.header.frame_id = "odom";
    X.child_frame_id = "base";
    X.transform.translation.x = speed * (stamp - 100.0);
    EXPECT_EQ(buffer_.add(X, "/base", false, ros::Time(stamp)), "");
  }

  // The bound of the robot just after `last`, until when transforms have come.
  double lower_bound(double last) {
    const RobotDescription description =
        parse_urdf(kUrdf, GeometrySource::kCollision, [](const std::string&) { return ""; });
    const auto robot = build_robot_model(description, RobotModelConfig());
    auto poses = std::make_unique<StatedPoseSource>(std::make_shared<const Kinematics>(description),
                                                    buffer_, "odom", link_names(*robot), 1.0, 0.01,
                                                    StatedPoseSource::Stamp::kNow);
    EXPECT_EQ(poses->state({}), "");
    tray_->set_model(robot, "odom", RegionOfInterest());
    ProximityCycle cycle(test::ready_model(robot), config_, std::move(poses),
                         CloudSelection::Reader::kOther);
    ProximityArray message;
    cycle.run(ros::Time(last + 1e-3), sources_, live_, "", &message);
    EXPECT_EQ(message.links.size(), 1U);
    EXPECT_EQ(message.links.at(0).state, message.links.at(0).NEAR) << message.status_text;
    return message.links.at(0).lower_bound;
  }

  TransformBuffer buffer_{ros::Duration(10.0)};
  TraySource* tray_ = nullptr;
  CloudSources sources_;
  ServerConfig config_;
  LiveConfig live_;
};

// A tray that was newer than the base was farther away than it is.
TEST_F(StatedPosesTest, ATrayIsNeverNewerThanTheBaseThatCarriesIt) {
  const double gap = kReach - kRadius;
  for (const double speed : {0.3, -0.3}) {
    for (const bool is_before : {true, false}) {
      buffer_.clear();
      double stamp = 100.0;
      for (; stamp < 101.0; stamp += kPeriod) tell(speed, stamp);
      int told = 0;
      tray_->before = tray_->after = nullptr;
      (is_before ? tray_->before : tray_->after) = [&] { tell(speed, stamp + kPeriod * told++); };
      const double bound = lower_bound(stamp);
      EXPECT_EQ(told, 1);
      EXPECT_LE(bound, gap + 1e-6) << "speed " << speed << ", before " << is_before;
      EXPECT_GT(bound, gap - 0.02) << "speed " << speed << ", before " << is_before;
    }
  }
}

}  // namespace
}  // namespace ist
