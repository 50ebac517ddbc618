#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <visualization_msgs/MarkerArray.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <vector>

#include "ros/model/model_state.h"

namespace ist {

/// Publishes the packing's spheres on ~spheres, latched. Thread safe; the cycle does not wait for
/// other threads.
class SpherePublisher {
 public:
  explicit SpherePublisher(ros::NodeHandle private_nh);

  /// Shows the monitored links of a model, if that is not shown already; none while there is no
  /// robot. It is called by a slow thread, whose rate bounds how often the markers change.
  void show(const ModelState& model);

  /// Colours the links' spheres by nearness, as ~markers are, at most twice a second. Only where a
  /// link's colour has changed and somebody listens, because all spheres are sent again.
  /// @param max_distance  [m]
  void show_nearness(const ist_proximity::ProximityArray& proximity, double max_distance);

  /// Must be called when the ROS clock has jumped back. rviz then forgets all markers some time
  /// later, latched or not, so they are published again after 1, 3 and 7 seconds.
  void repeat_after_clock_jump();
  /// Must be called regularly; repeats the markers when it is time.
  void repeat_when_due();

 private:
  using Clock = std::chrono::steady_clock;

  ros::Publisher publisher_;
  std::mutex mutex_;                               // guards all below
  std::shared_ptr<const RobotModel> shown_robot_;  ///< null: none is shown
  visualization_msgs::MarkerArray shown_;
  Clock::time_point next_repeat_ = Clock::time_point::max();
  std::chrono::seconds repeat_delay_{0};
  std::vector<int> shades_;  ///< by link of the message: what is shown
  Clock::time_point next_shades_;
};

}  // namespace ist
