#include "ros/poses/joint_state_listener.h"

#include <ros/console.h>
#include <tf2/exceptions.h>

#include <cmath>
#include <sstream>

#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kMaxAhead = 1.0;     // [s] the same as for transforms
constexpr double kLimitSlack = 1e-3;  // [rad, m] accuracy of encoders and controllers
constexpr std::chrono::seconds kProblemAge(1);

}  // namespace

JointStateListener::JointStateListener(tf2::BufferCore* buffer, ros::NodeHandle nh,
                                       std::function<void()> on_state)
    : buffer_(*buffer), on_state_(std::move(on_state)) {
  report_.topic = nh.resolveName("joint_states");
  nh.setCallbackQueue(thread_.queue());
  subscriber_ = nh.subscribe("joint_states", 100, &JointStateListener::receive, this,
                             ros::TransportHints().tcpNoDelay());
  thread_.start("ist joints", [this] { count_publishers(); });
}

JointStateListener::~JointStateListener() {
  thread_.stop();
  subscriber_.shutdown();
}

void JointStateListener::set_kinematics(std::shared_ptr<const Kinematics> kinematics) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (kinematics == kinematics_) return;
  kinematics_ = std::move(kinematics);
  index_.clear();
  moved_by_.clear();
  forget();
  report_.messages = report_.used = report_.dropped = report_.skipped = 0;
  report_.problem.clear();
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

void JointStateListener::newest(const Kinematics& kinematics, JointPositions* positions) {
  copy(positions_.newest(), kinematics, positions);
}

void JointStateListener::take_next() {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  positions_.take_next();
}

void JointStateListener::taken(const Kinematics& kinematics, JointPositions* positions) {
  copy(positions_.taken(), kinematics, positions);
}

void JointStateListener::copy(const JointPositions& from, const Kinematics& kinematics,
                              JointPositions* positions) {
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
  return positions_.is_waiting();
}

JointStateReport JointStateListener::report() {
  const std::lock_guard<std::mutex> lock(mutex_);
  JointStateReport report = report_;
  if (std::chrono::steady_clock::now() - problem_time_ > kProblemAge) report.problem.clear();
  return report;
}

/// The caller holds mutex_.
void JointStateListener::notice_clock_jump() {
  const ros::Time now = ros::Time::now();
  if (now < last_now_) forget();
  last_now_ = now;
}

/// The caller holds mutex_.
void JointStateListener::forget() {
  positions_.reset(kinematics_ ? kinematics_->joints().size() : 0);
}

/// Counts outside report(), because roscpp's answer can wait for the master.
void JointStateListener::count_publishers() {
  const std::optional<std::uint32_t> publishers = publisher_count_.ask(subscriber_);
  if (!publishers) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  report_.publishers = *publishers;
}

void JointStateListener::drop(const std::string& problem, std::size_t count) {
  report_.problem = problem;
  report_.dropped += count;
  problem_time_ = std::chrono::steady_clock::now();
  ROS_WARN_STREAM_THROTTLE(5.0, report_.topic << ": " << problem);
}

void JointStateListener::receive(const sensor_msgs::JointStateConstPtr& message) {
  bool is_new = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    notice_clock_jump();
    if (!kinematics_) return;
    ++report_.messages;
    is_new = read(*message);
    if (is_new) {
      ++report_.used;
      report_.skipped += positions_.push();
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
  return format_text("a message is stamped %.2f s in the future and not used: compare the clocks",
                     ahead);
}

/// Reads all positions of a message; returns whether one of them was new.
bool JointStateListener::read(const sensor_msgs::JointState& message) {
  if (message.position.empty()) return false;  // the message holds velocities or efforts alone
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
    // Many publishers state mimic joints too, which follow theirs; a fixed joint stays in place.
    if (joint.has_unstated_pose()) {
      drop("joint '" + name + "' is planar or floating, so its pose must come from tf", 1);
    }
    return false;
  }
  if (!std::isfinite(q)) {
    drop("the position of joint '" + name + "' is NaN or infinite and is not used", 1);
    return false;
  }
  if (stamp <= positions_.newest()[found->second].stamp) return false;  // out of order or repeated
  if (q < joint.lower - kLimitSlack || q > joint.upper + kLimitSlack) {
    std::ostringstream text;
    text << "joint '" << name << "' is at " << q << ", outside its limits of " << joint.lower
         << " to " << joint.upper << "; it is used all the same";
    drop(text.str(), 0);
  }
  positions_.set(found->second, {q, stamp});
  for (const std::size_t j : moved_by_[found->second]) put_into_tf(j, stamp, false);
  return true;
}

void JointStateListener::put_into_tf(std::size_t joint, const ros::Time& stamp, bool is_static) {
  const Kinematics::Joint& at = kinematics_->joints()[joint];
  const double q = is_static ? 0.0 : at.multiplier * positions_.newest()[at.source].q + at.offset;
  geometry_msgs::TransformStamped message;
  message.transform = to_message(kinematics_->joint_pose(joint, q));
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
    if (joint.has_unstated_pose()) continue;
    frames.push_back(without_slash(kinematics.bodies()[joint.child]));
  }
  return frames;
}

}  // namespace ist
