#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Geometry>
#include <atomic>
#include <functional>
#include <thread>
#include <vector>

#include "ist_proximity/robot/kinematics.h"

namespace ist::benchmark {

/// An organized image of 640 columns in the camera's frame, without a stamp.
sensor_msgs::PointCloud2Ptr make_cloud(const std::vector<Eigen::Vector3f>& points);

/// Messages of a robot and its camera, each from its own thread: joint states at 1 kHz on
/// `joint_states`, an organized 640x480 cloud at 30 Hz on `cloud`, and the camera's pose.
class Traffic {
 public:
  /// What is called by these threads.
  struct Source {
    /// Positions by joint at a stamp; NaN: not sent.
    std::function<std::vector<double>(const ros::Time&)> positions;
    /// The next image, without a stamp.
    std::function<sensor_msgs::PointCloud2Ptr()> picture;
    /// Told of its stamp before it is sent.
    std::function<void(const ros::Time&)> on_cloud;
  };

  /// @param kinematics  outlives this
  /// @param X_RS        camera -> root link
  Traffic(const Kinematics& kinematics, const Eigen::Isometry3d& X_RS, const Source& source);
  ~Traffic();

 private:
  void send_state();
  void send_cloud();

  const Kinematics& kinematics_;
  Source source_;
  ros::NodeHandle nh_;
  ros::Publisher static_tf_, states_, clouds_;
  std::atomic<bool> go_on_{true};
  std::thread state_thread_, cloud_thread_;
};

}  // namespace ist::benchmark
