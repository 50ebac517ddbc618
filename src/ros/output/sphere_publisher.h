#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <visualization_msgs/MarkerArray.h>

#include <atomic>
#include <chrono>
#include <memory>

#include "ros/model/model_state.h"
#include "ros/output/markers.h"

namespace ist {

/// Publishes the packing's spheres on ~spheres, latched. One thread.
class SpherePublisher {
 public:
  explicit SpherePublisher(ros::NodeHandle private_nh);

  /// Shows the monitored links of a model, if that is not shown already; none while there is no
  /// robot. It is called by a slow thread, whose rate bounds how often the markers change.
  void show(const ModelState& model);

  /// Must be called when the ROS clock has jumped back. rviz then forgets all markers some time
  /// later, latched or not, so show() publishes them again after 1, 3 and 7 seconds. Thread safe.
  void repeat_after_clock_jump() { has_jumped_ = true; }

 private:
  using Clock = std::chrono::steady_clock;

  ros::Publisher publisher_;
  std::shared_ptr<const RobotModel> shown_robot_;  ///< null: none is shown
  visualization_msgs::MarkerArray spheres_;        ///< as sent last
  ShownMarkers shown_;
  std::atomic<bool> has_jumped_{false};
  Clock::time_point next_repeat_ = Clock::time_point::max();
  std::chrono::seconds repeat_delay_{0};
};

}  // namespace ist
