#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace ist {

/// Fills a tf buffer from /tf and /tf_static, in a thread of its own.
///
/// As tf2_ros::TransformListener, but transforms that are stamped far ahead of the clock stay
/// outside. When the clock jumps back (a bag starts over), one from before the jump can come in
/// after it; the buffer then takes it for the newest and refuses the present ones as too old (seen
/// with a 12 s bag in a loop: no poses for seconds).
class TransformListener {
 public:
  /// @param buffer  outlives this
  TransformListener(tf2::BufferCore* buffer, ros::NodeHandle nh);
  ~TransformListener();
  TransformListener(const TransformListener&) = delete;
  TransformListener& operator=(const TransformListener&) = delete;

  /// Empties the buffer if the ROS clock has jumped back since the last call or message; static
  /// transforms stay. Thread safe.
  void notice_clock_jump();

  /// Frames whose transforms stay outside from now on, because somebody else fills them in.
  /// Thread safe.
  void leave_out(const std::vector<std::string>& child_frames);

  /// What was kept out during the last second, as a sentence; empty when nothing was. Thread safe.
  std::string problem() const;

 private:
  void receive(const tf2_msgs::TFMessage& message, bool is_static);
  bool is_left_out(const std::string& child_frame) const;
  void keep_out(const geometry_msgs::TransformStamped& transform, double ahead);

  tf2::BufferCore& buffer_;
  ros::CallbackQueue queue_;
  ros::Subscriber moving_, static_;

  mutable std::mutex mutex_;
  ros::Time last_now_;
  std::string problem_;
  std::chrono::steady_clock::time_point problem_time_;
  std::set<std::string> left_out_;

  std::atomic<bool> running_{true};
  std::thread thread_;
};

}  // namespace ist
