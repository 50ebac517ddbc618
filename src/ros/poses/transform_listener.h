#pragma once

#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <tf2_msgs/TFMessage.h>

#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "ros/poses/transform_buffer.h"

namespace ist {

/// Fills a tf buffer from /tf and /tf_static, in the thread of the node handle's callback queue.
///
/// It differs from tf2_ros::TransformListener in that it rejects transforms that tf2 would refuse,
/// with a reason (see TransformBuffer), and those that are stamped far ahead of the clock. When the
/// clock jumps back (a bag starts over), a transform from before the jump can come in after it; the
/// buffer would take it for the newest and refuse the present ones as too old (seen with a 12 s bag
/// in a loop: no poses for seconds).
class TransformListener {
 public:
  /// @param buffer  outlives this
  TransformListener(TransformBuffer* buffer, ros::NodeHandle nh);

  /// Empties the buffer if the ROS clock has jumped back since the last call or message; static
  /// transforms stay. Thread safe.
  void notice_clock_jump();

  /// Does not use transforms of these frames from now on, because joint states supply them. Static
  /// ones that differ from the URDF's are disputes all the same. Thread safe.
  void ignore(const std::vector<std::string>& child_frames);

  /// A sentence about a transform that was rejected, or stamped ahead of the clock, during the last
  /// second; empty when there was none. Thread safe.
  std::string problem() const;

 private:
  void receive(const ros::MessageEvent<const tf2_msgs::TFMessage>& event, bool is_static);
  bool is_ignored(const std::string& child_frame) const;

  TransformBuffer& buffer_;
  ros::Subscriber moving_, static_;

  mutable std::mutex mutex_;
  ros::Time last_now_;
  std::set<std::string> ignored_;
};

}  // namespace ist
