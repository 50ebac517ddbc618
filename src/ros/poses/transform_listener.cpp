#include "ros/poses/transform_listener.h"

#include <ros/console.h>

#include <boost/function.hpp>

#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"

namespace ist {
TransformListener::TransformListener(TransformBuffer* buffer, ros::NodeHandle nh)
    : buffer_(*buffer) {
  const auto hints = ros::TransportHints().tcpNoDelay();
  using Event = ros::MessageEvent<const tf2_msgs::TFMessage>;
  using Callback = boost::function<void(const Event&)>;
  const Callback receive_moving = [this](const Event& event) { receive(event, false); };
  const Callback receive_static = [this](const Event& event) { receive(event, true); };
  moving_ = nh.subscribe<tf2_msgs::TFMessage, const Event&>("/tf", 100, receive_moving, {}, hints);
  static_ =
      nh.subscribe<tf2_msgs::TFMessage, const Event&>("/tf_static", 100, receive_static, {}, hints);
}

void TransformListener::notice_clock_jump() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::Time now = ros::Time::now();
  if (now < last_now_) {
    ROS_WARN("the ROS clock jumped back by %.3f s: transforms and clouds from before are dropped",
             seconds_between(now, last_now_));
    buffer_.clear();
  }
  last_now_ = now;
}

void TransformListener::receive(const ros::MessageEvent<const tf2_msgs::TFMessage>& event,
                                bool is_static) {
  notice_clock_jump();
  const ros::Time now = ros::Time::now();
  const TransformBuffer::Publisher publisher(event.getPublisherName(),
                                             event.getConnectionHeaderPtr());
  for (const auto& transform : event.getConstMessage()->transforms) {
    if (is_ignored(transform.child_frame_id)) {
      if (is_static) buffer_.compare(transform, publisher, now);
      continue;
    }
    const std::string problem = buffer_.add(transform, publisher, is_static, now);
    if (!problem.empty()) ROS_WARN_STREAM_THROTTLE(5.0, problem);
  }
  const std::string ahead = buffer_.ahead();
  if (!ahead.empty()) ROS_WARN_STREAM_THROTTLE(60.0, ahead);
}

void TransformListener::ignore(const std::vector<std::string>& child_frames) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ignored_ = {child_frames.begin(), child_frames.end()};
}

bool TransformListener::is_ignored(const std::string& child_frame) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !ignored_.empty() && ignored_.count(without_slash(child_frame)) > 0;
}

std::string TransformListener::problem() const {
  const std::string refusal = buffer_.last_refusal();
  return refusal.empty() ? buffer_.ahead() : refusal;
}

}  // namespace ist
