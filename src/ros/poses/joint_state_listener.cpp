#include "ros/poses/joint_state_listener.h"

#include <ros/console.h>
#include <tf2/exceptions.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "ros/poses/transforms.h"
#include "ros/ros_time.h"
#include "ros/thread_name.h"

namespace ist {
namespace {

constexpr double kMaxAhead = 1.0;     // [s] as for transforms
constexpr double kLimitSlack = 1e-3;  // [rad, m] encoders and controllers are not that exact
constexpr std::chrono::seconds kProblemAge(1);
constexpr std::size_t kMaxWaiting = 10;

geometry_msgs::TransformStamped to_message(const Eigen::Isometry3d& X) {
  geometry_msgs::TransformStamped message;
  const Eigen::Quaterniond q(X.linear());
  message.transform.translation.x = X.translation().x();
  message.transform.translation.y = X.translation().y();
  message.transform.translation.z = X.translation().z();
  message.transform.rotation.x = q.x();
  message.transform.rotation.y = q.y();
  message.transform.rotation.z = q.z();
  message.transform.rotation.w = q.w();
  return message;
}

}  // namespace

JointStateListener::JointStateListener(tf2::BufferCore* buffer, ros::NodeHandle nh,
                                       std::function<void()> on_state)
    : buffer_(*buffer), on_state_(std::move(on_state)) {
  facts_.topic = nh.resolveName("joint_states");
  nh.setCallbackQueue(&queue_);
  subscriber_ = nh.subscribe("joint_states", 100, &JointStateListener::receive, this,
                             ros::TransportHints().tcpNoDelay());
  thread_ = std::thread([this] {
    name_thread("ist joints");
    while (running_) {
      queue_.callAvailable(ros::WallDuration(0.05));
      count_publishers();
    }
  });
}

JointStateListener::~JointStateListener() {
  running_ = false;
  thread_.join();
  subscriber_.shutdown();
}

void JointStateListener::set_kinematics(std::shared_ptr<const Kinematics> kinematics) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (kinematics == kinematics_) return;
  kinematics_ = std::move(kinematics);
  index_.clear();
  moved_by_.clear();
  forget();
  facts_.messages = facts_.used = facts_.dropped = facts_.skipped = 0;
  facts_.problem.clear();
  if (!kinematics_) return;
  const std::size_t count = kinematics_->joints().size();
  moved_by_.resize(count);
  for (std::size_t j = 0; j < count; ++j) {
    const Kinematics::Joint& joint = kinematics_->joints()[j];
    index_[joint.name] = j;
    if (joint.type == JointType::kFixed) {
      put_into_tf(j, ros::Time(), true);
    } else if (!joint.has_unstated_pose()) {
      moved_by_[joint.source].push_back(j);
    }
  }
}

void JointStateListener::newest(const Kinematics& kinematics, std::vector<Position>* positions) {
  copy(positions_, kinematics, positions);
}

void JointStateListener::take_next() {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  if (waiting_.empty()) {
    taken_ = positions_;
    return;
  }
  taken_.swap(waiting_.front());
  waiting_.pop_front();
}

void JointStateListener::taken(const Kinematics& kinematics, std::vector<Position>* positions) {
  copy(taken_, kinematics, positions);
}

void JointStateListener::copy(const std::vector<Position>& from, const Kinematics& kinematics,
                              std::vector<Position>* positions) {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  if (&kinematics == kinematics_.get()) {
    *positions = from;
  } else {
    positions->clear();
  }
}

bool JointStateListener::is_waiting() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !waiting_.empty();
}

JointStateFacts JointStateListener::facts() {
  const std::lock_guard<std::mutex> lock(mutex_);
  JointStateFacts facts = facts_;
  if (std::chrono::steady_clock::now() - problem_time_ > kProblemAge) facts.problem.clear();
  return facts;
}

/// With mutex_ held.
void JointStateListener::notice_clock_jump() {
  const ros::Time now = ros::Time::now();
  if (now < last_now_) forget();
  last_now_ = now;
}

/// With mutex_ held, as enqueue().
void JointStateListener::forget() {
  positions_.assign(kinematics_ ? kinematics_->joints().size() : 0, Position());
  taken_ = positions_;
  waiting_.clear();
}

void JointStateListener::enqueue() {
  if (waiting_.size() == kMaxWaiting) {
    facts_.skipped += waiting_.size();
    waiting_.clear();
  }
  waiting_.push_back(positions_);
}

/// Not in facts(): roscpp's answer can wait for the master.
void JointStateListener::count_publishers() {
  const std::optional<std::uint32_t> publishers = publisher_count_.ask(subscriber_);
  if (!publishers) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  facts_.publishers = *publishers;
}

void JointStateListener::drop(const std::string& problem, std::size_t count) {
  facts_.problem = problem;
  facts_.dropped += count;
  problem_time_ = std::chrono::steady_clock::now();
  ROS_WARN_STREAM_THROTTLE(5.0, facts_.topic << ": " << problem);
}

void JointStateListener::receive(const sensor_msgs::JointStateConstPtr& message) {
  bool is_new = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    notice_clock_jump();
    if (!kinematics_) return;
    ++facts_.messages;
    is_new = read(*message);
    if (is_new) {
      ++facts_.used;
      enqueue();
    }
  }
  if (is_new) on_state_();
}

std::string JointStateListener::why_unusable(const sensor_msgs::JointState& message) const {
  if (message.position.size() != message.name.size()) {
    return "a message has " + std::to_string(message.name.size()) + " names and " +
           std::to_string(message.position.size()) + " positions: it is not used";
  }
  if (message.header.stamp.isZero()) {
    return "a message has no stamp (0) and is not used: the publisher must set header.stamp";
  }
  const double ahead = seconds_between(last_now_, message.header.stamp);
  if (ahead <= kMaxAhead) return "";
  char text[96];
  std::snprintf(text, sizeof text, "a message is stamped %.2f s in the future", ahead);
  return text + std::string(" and not used: compare the clocks");
}

/// Whether a joint's position was new.
bool JointStateListener::read(const sensor_msgs::JointState& message) {
  if (message.position.empty()) return false;  // velocities or efforts alone
  const std::string problem = why_unusable(message);
  if (!problem.empty()) {
    drop(problem, message.position.size());
    return false;
  }
  bool is_new = false;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    is_new = read_joint(message.name[i], message.position[i], message.header.stamp) || is_new;
  }
  return is_new;
}

bool JointStateListener::read_joint(const std::string& name, double q, const ros::Time& stamp) {
  const auto found = index_.find(name);
  if (found == index_.end()) {
    drop("joint '" + name + "' is not in the URDF: its position is not used", 1);
    return false;
  }
  const Kinematics::Joint& joint = kinematics_->joints()[found->second];
  if (!joint.is_free()) {
    // Many publishers tell mimic joints too; and a fixed one, whatever for, stays where it is.
    if (joint.has_unstated_pose()) {
      drop("joint '" + name + "' is planar or floating, which one position cannot tell: tf must",
           1);
    }
    return false;
  }
  if (!std::isfinite(q)) {
    drop("the position of joint '" + name + "' is NaN or infinite and is not used", 1);
    return false;
  }
  Position& position = positions_[found->second];
  if (stamp <= position.stamp) return false;  // out of order, or told twice
  if (q < joint.lower - kLimitSlack || q > joint.upper + kLimitSlack) {
    std::ostringstream text;
    text << "joint '" << name << "' is at " << q << ", outside its limits of " << joint.lower
         << " to " << joint.upper << "; it is used all the same";
    drop(text.str(), 0);
  }
  position = {q, stamp};
  for (const std::size_t j : moved_by_[found->second]) put_into_tf(j, stamp, false);
  return true;
}

void JointStateListener::put_into_tf(std::size_t joint, const ros::Time& stamp, bool is_static) {
  const Kinematics::Joint& at = kinematics_->joints()[joint];
  const double q = is_static ? 0.0 : at.multiplier * positions_[at.source].q + at.offset;
  geometry_msgs::TransformStamped message = to_message(kinematics_->joint_pose(joint, q));
  message.header.stamp = stamp;
  message.header.frame_id = kinematics_->bodies()[at.parent];
  message.child_frame_id = kinematics_->bodies()[at.child];
  try {
    buffer_.setTransform(message, "joint_states", is_static);
  } catch (const std::exception& error) {
    drop(error.what(), 1);
  }
}

std::vector<std::string> computed_frames(const Kinematics& kinematics) {
  std::vector<std::string> frames;
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    if (!joint.has_unstated_pose())
      frames.push_back(without_slash(kinematics.bodies()[joint.child]));
  }
  return frames;
}

}  // namespace ist
