// Passes joint velocities on, slowed down near obstacles.
//
//   rosrun ist_proximity slow_down wanted:=task/velocities allowed:=velocity_controller/command
//
// wanted:  subscribed, std_msgs/Float64MultiArray, the task's joint velocities
// allowed: published at 100 Hz, the same times the speed scale; 0 where either is missing or old

#include <ros/ros.h>
#include <std_msgs/Float64MultiArray.h>

#include <algorithm>

#include "ist_proximity/SpeedScaleState.h"

constexpr double kRate = 100.0;  // [Hz]
constexpr double kMaxAge = 0.1;  // [s] Five messages of a node at 50 Hz may be lost; then it stops.

int main(int argc, char** argv) {
  ros::init(argc, argv, "slow_down");
  ros::NodeHandle nh;
  ist_proximity::SpeedScaleState state;
  std_msgs::Float64MultiArray wanted;
  ros::Time wanted_at;
  const ros::Publisher allowed = nh.advertise<std_msgs::Float64MultiArray>("allowed", 1);
  const ros::Subscriber states = nh.subscribe<ist_proximity::SpeedScaleState>(
      "proximity/speed_scale_state", 1, [&](const auto& message) { state = *message; });
  const ros::Subscriber wishes =
      nh.subscribe<std_msgs::Float64MultiArray>("wanted", 1, [&](const auto& message) {
        wanted = *message;
        wanted_at = ros::Time::now();
      });
  const ros::Timer timer = nh.createTimer(ros::Duration(1.0 / kRate), [&](const ros::TimerEvent&) {
    const ros::Time oldest = std::min(wanted_at, state.header.stamp);  // 0 before the first
    const bool is_fresh = (ros::Time::now() - oldest).toSec() <= kMaxAge;
    const double scale = is_fresh ? state.scale : 0.0;
    const char* none = "no fresh speed scale, or no fresh velocities";
    if (scale < 1.0) {
      ROS_INFO_THROTTLE(1.0, "%.0f %% of the speed: %s", 100.0 * scale,
                        is_fresh ? state.text.c_str() : none);
    }
    std_msgs::Float64MultiArray message;
    for (const double velocity : wanted.data) message.data.push_back(scale * velocity);
    allowed.publish(message);
  });
  ros::spin();
}
