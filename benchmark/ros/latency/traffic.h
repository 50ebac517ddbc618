#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/PointCloud2.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include "ist_proximity/robot/kinematics.h"

namespace ist::benchmark {

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
