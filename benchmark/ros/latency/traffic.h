#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "support.h"

namespace ist::benchmark {

constexpr double kStateRate = 1000.0, kCloudRate = 30.0;  // [Hz]

/// An organized image of 640 columns in the camera's frame, without a stamp.
sensor_msgs::PointCloud2 make_cloud(const std::vector<Eigen::Vector3f>& points);

/// Where the camera stands: sensor -> root link.
tf2_msgs::TFMessage camera_pose(const std::string& root, const Eigen::Isometry3d& X_RS);

/// Calls `send` at a rate [Hz] while `go_on` holds.
template <typename Send>
void repeat(double rate, const std::atomic<bool>& go_on, const Send& send) {
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / rate));
  for (auto next = Clock::now(); go_on; next = std::max(next + period, Clock::now() - period)) {
    std::this_thread::sleep_until(next);
    send();
  }
}

/// Messages of a robot and its camera: joint states at 1 kHz on `joint_states`, an organized
/// 640x480 cloud at 30 Hz on `cloud`, each from its own thread, and the camera's pose.
class Traffic {
 public:
  using OnSend = std::function<void(const ros::Time&)>;

  /// @param kinematics outlives this; its free joints swing
  /// @param pcd        an organized cloud of 640 columns; empty: a wavy wall in front of the robot
  /// @param camera     file with 4 x 4 numbers, sensor -> root link; empty: at the root link
  /// @param on_state, on_cloud  called before each message, with its stamp
  Traffic(const Kinematics& kinematics, const std::string& pcd, const std::string& camera,
          OnSend on_state, OnSend on_cloud);
  ~Traffic();

 private:
  void place_camera(const std::string& file);
  void send_state();
  void send_cloud(const sensor_msgs::PointCloud2& content);

  const Kinematics& kinematics_;
  OnSend on_state_, on_cloud_;
  ros::NodeHandle nh_;
  ros::Publisher static_tf_, states_, clouds_;
  std::atomic<bool> go_on_{true};
  std::thread state_thread_, cloud_thread_;
};

}  // namespace ist::benchmark
