#include "ros/poses/transform_listener.h"

#include <ros/console.h>

#include <boost/function.hpp>
#include <cstdio>
#include <exception>

#include "ros/poses/transforms.h"
#include "ros/ros_time.h"
#include "ros/thread_name.h"

namespace ist {
namespace {

// Some publishers stamp fixed joints half a second ahead.
constexpr double kMaxAhead = 1.0;  // [s]
constexpr std::chrono::seconds kProblemAge(1);

}  // namespace

TransformListener::TransformListener(tf2::BufferCore* buffer, ros::NodeHandle nh)
    : buffer_(*buffer) {
  nh.setCallbackQueue(&queue_);
  const auto hints = ros::TransportHints().tcpNoDelay();
  using Callback = boost::function<void(const tf2_msgs::TFMessageConstPtr&)>;
  const Callback receive_moving = [this](const tf2_msgs::TFMessageConstPtr& message) {
    receive(*message, false);
  };
  const Callback receive_static = [this](const tf2_msgs::TFMessageConstPtr& message) {
    receive(*message, true);
  };
  moving_ = nh.subscribe<tf2_msgs::TFMessage>("/tf", 100, receive_moving, {}, hints);
  static_ = nh.subscribe<tf2_msgs::TFMessage>("/tf_static", 100, receive_static, {}, hints);
  thread_ = std::thread([this] {
    name_thread("ist tf");
    while (running_) queue_.callAvailable(ros::WallDuration(0.05));
  });
}

TransformListener::~TransformListener() {
  running_ = false;
  thread_.join();
  moving_.shutdown();
  static_.shutdown();
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

void TransformListener::receive(const tf2_msgs::TFMessage& message, bool is_static) {
  notice_clock_jump();
  const ros::Time now = ros::Time::now();
  for (const auto& transform : message.transforms) {
    if (is_left_out(transform.child_frame_id)) continue;
    const double ahead = seconds_between(now, transform.header.stamp);
    if (!is_static && ahead > kMaxAhead) {
      keep_out(transform, ahead);
      continue;
    }
    try {  // what is wrong with the numbers, tf2 says itself
      buffer_.setTransform(transform, is_static ? "/tf_static" : "/tf", is_static);
    } catch (const std::exception& error) {
      ROS_WARN_STREAM_THROTTLE(5.0, "the transform of '" << transform.child_frame_id
                                                         << "' is not used: " << error.what());
    }
  }
}

void TransformListener::keep_out(const geometry_msgs::TransformStamped& transform, double ahead) {
  char text[96];
  std::snprintf(text, sizeof text, "' is stamped %.2f s in the future and not used", ahead);
  const std::lock_guard<std::mutex> lock(mutex_);
  problem_ = "the transform from '" + transform.child_frame_id + "' to '" +
             transform.header.frame_id + text + ": compare the clocks";
  problem_time_ = std::chrono::steady_clock::now();
}

void TransformListener::leave_out(const std::vector<std::string>& child_frames) {
  const std::lock_guard<std::mutex> lock(mutex_);
  left_out_ = {child_frames.begin(), child_frames.end()};
}

bool TransformListener::is_left_out(const std::string& child_frame) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !left_out_.empty() && left_out_.count(without_slash(child_frame)) > 0;
}

std::string TransformListener::problem() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool recent = std::chrono::steady_clock::now() - problem_time_ < kProblemAge;
  return recent ? problem_ : std::string();
}

}  // namespace ist
