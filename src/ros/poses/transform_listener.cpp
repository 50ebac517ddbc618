#include "ros/poses/transform_listener.h"

#include <ros/console.h>

#include <boost/function.hpp>
#include <exception>

#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kMaxAhead = 1.0;  // [s] some publishers stamp fixed joints half a second ahead
constexpr std::chrono::seconds kProblemAge(1);

}  // namespace

TransformListener::TransformListener(tf2::BufferCore* buffer, ros::NodeHandle nh)
    : buffer_(*buffer) {
  nh.setCallbackQueue(thread_.queue());
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
  thread_.start("ist tf");
}

TransformListener::~TransformListener() {
  thread_.stop();
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
    if (is_ignored(transform.child_frame_id)) continue;
    const double ahead = seconds_between(now, transform.header.stamp);
    if (!is_static && ahead > kMaxAhead) {
      reject(transform, ahead);
      continue;
    }
    try {  // tf2 itself logs what is wrong with the numbers
      buffer_.setTransform(transform, is_static ? "/tf_static" : "/tf", is_static);
    } catch (const std::exception& error) {
      ROS_WARN_STREAM_THROTTLE(5.0, "the transform of '" << transform.child_frame_id
                                                         << "' is not used: " << error.what());
    }
  }
}

void TransformListener::reject(const geometry_msgs::TransformStamped& transform, double ahead) {
  const std::lock_guard<std::mutex> lock(mutex_);
  problem_ =
      "the transform from '" + transform.child_frame_id + "' to '" + transform.header.frame_id +
      format_text("' is stamped %.2f s in the future and not used: compare the clocks", ahead);
  problem_time_ = std::chrono::steady_clock::now();
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
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool recent = std::chrono::steady_clock::now() - problem_time_ < kProblemAge;
  return recent ? problem_ : std::string();
}

}  // namespace ist
