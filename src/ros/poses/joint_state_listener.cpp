#include "ros/poses/joint_state_listener.h"

#include <ros/console.h>

#include <algorithm>
#include <boost/function.hpp>
#include <cmath>
#include <sstream>
#include <utility>

#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/poses/position_limits.h"

namespace ist {
namespace {

constexpr double kLimitSlack = 1e-3;  // [rad, m] accuracy of encoders and controllers
constexpr std::chrono::seconds kProblemAge(1);
// A message with more names is refused: it would take longer than a cycle to read, and no robot has
// as many joints.
constexpr std::size_t kMaxNames = 10000;
constexpr double kAgreement = 0.01;  // [rad, m] between a mimic joint and where its leader puts it
constexpr double kMaxSpacing = 1.0;  // [s] after a longer pause, the usual spacing is not known
constexpr std::size_t kMaxWaiting = 10;
constexpr std::size_t kNowhere = static_cast<std::size_t>(-1);

// Whether the same positions put the same links to the same places.
bool is_same_motion(const Kinematics& a, const Kinematics& b) {
  const auto is_same = [](const Kinematics::Joint& one, const Kinematics::Joint& other) {
    return one.name == other.name && one.type == other.type && one.parent == other.parent &&
           one.X_PJ.matrix() == other.X_PJ.matrix() && one.axis == other.axis &&
           one.leader == other.leader && one.mimic.multiplier == other.mimic.multiplier &&
           one.mimic.offset == other.mimic.offset;
  };
  return a.bodies() == b.bodies() && std::equal(a.joints().begin(), a.joints().end(),
                                                b.joints().begin(), b.joints().end(), is_same);
}

}  // namespace

JointStateListener::JointStateListener(TransformBuffer* buffer, ros::NodeHandle nh,
                                       const std::string& topic, std::string prefix,
                                       std::function<void()> on_state)
    : buffer_(*buffer),
      prefix_(std::move(prefix)),
      urdf_(prefix_ + "the URDF"),
      on_state_(std::move(on_state)) {
  report_.topic = nh.resolveName(topic);
  using Event = ros::MessageEvent<const sensor_msgs::JointState>;
  const boost::function<void(const Event&)> callback = [this](const Event& event) {
    receive(event);
  };
  subscriber_ = nh.subscribe<sensor_msgs::JointState, const Event&>(
      topic, 100, callback, {}, ros::TransportHints().tcpNoDelay());
}

void JointStateListener::set_kinematics(std::shared_ptr<const Kinematics> kinematics) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (kinematics == kinematics_) return;
  kinematics_ = std::move(kinematics);
  if (kinematics_) {
    // Nothing is placed by what the joints of another robot were.
    if (in_tf_ && !is_same_motion(*in_tf_, *kinematics_)) buffer_.clear();
    in_tf_ = kinematics_;
  }
  buffer_.withdraw(urdf_);
  index_.clear();
  led_by_.clear();
  forget();
  report_.messages = report_.used = report_.dropped = report_.skipped = 0;
  report_.problem.clear();
  if (!kinematics_) return;
  const std::size_t count = kinematics_->joints().size();
  led_by_.resize(count);
  for (std::size_t j = 0; j < count; ++j) {
    const Kinematics::Joint& joint = kinematics_->joints()[j];
    index_[joint.name] = j;
    if (joint.type == JointType::kFixed) {
      put_into_tf(j, 0.0, ros::Time(), urdf_);
    } else if (joint.leader != j) {
      led_by_[joint.leader].push_back(j);
    }
  }
}

void JointStateListener::read(Which which, const Kinematics& kinematics,
                              JointPositions* positions) {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  if (&kinematics != kinematics_.get()) return positions->clear();
  *positions = which == Which::kTaken ? taken_ : newest_;
}

void JointStateListener::take_next() {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  if (waiting_.empty()) {
    taken_ = newest_;
  } else {
    taken_.swap(waiting_.front());
    waiting_.pop_front();
  }
}

bool JointStateListener::is_waiting() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !waiting_.empty();
}

std::string JointStateListener::topic() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return report_.topic;
}

JointStateReport JointStateListener::report() {
  const std::uint32_t publishers = subscriber_.getNumPublishers();
  const std::lock_guard<std::mutex> lock(mutex_);
  JointStateReport report = report_;
  report.publishers = publishers;
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
  const std::size_t joints = kinematics_ ? kinematics_->joints().size() : 0;
  newest_.assign(joints, JointPosition());
  taken_ = newest_;
  waiting_.clear();
  stated_.clear();
  place_.assign(joints, kNowhere);
}

void JointStateListener::drop(const std::string& problem, std::size_t count) {
  report_.problem = problem;
  report_.dropped += count;
  problem_time_ = std::chrono::steady_clock::now();
  ROS_WARN_STREAM_THROTTLE(5.0, report_.topic << ": " << problem);
}

void JointStateListener::receive(const ros::MessageEvent<const sensor_msgs::JointState>& event) {
  bool is_new = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    notice_clock_jump();
    if (!kinematics_) return;
    ++report_.messages;
    is_new = use_message(*event.getConstMessage(), event.getPublisherName());
    if (is_new) {
      ++report_.used;
      if (waiting_.size() == kMaxWaiting) {
        report_.skipped += waiting_.size();
        waiting_.clear();
      }
      waiting_.push_back(newest_);
    }
  }
  if (is_new) on_state_();
}

std::string JointStateListener::why_unusable(const sensor_msgs::JointState& message) const {
  if (message.name.size() > kMaxNames) {
    return "a message has " + std::to_string(message.name.size()) + " names, allowed are " +
           std::to_string(kMaxNames) + ": it is not used";
  }
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

/// Keeps what a message states about a joint, and what is wrong with it.
void JointStateListener::collect_joint(std::size_t j, double q, double velocity) {
  const std::string& name = kinematics_->joints()[j].name;
  if (place_[j] == kNowhere) {
    place_[j] = stated_.size();
    stated_.push_back({j, q, velocity, ""});
    const std::string fault = why_not_a_position(kinematics_->joints()[j], q);
    if (fault.empty()) return;
    stated_.back().fault = "the position of joint '" + name + "' " + fault + " and is not used";
  } else if (Stated& first = stated_[place_[j]]; first.fault.empty() && !(first.q == q)) {
    first.fault =
        "joint '" + name +
        format_text("' is stated twice in a message, at %g and at %g: it is not used", first.q, q);
  }
}

/// Finds the joints that a message states, each once, and what is wrong with them.
/// @param complains  whether names that are no joints are reported
void JointStateListener::collect(const sensor_msgs::JointState& message, bool complains) {
  for (const Stated& one : stated_) place_[one.joint] = kNowhere;
  stated_.clear();
  const std::string* unknown = nullptr;
  std::size_t unknowns = 0;
  for (std::size_t i = 0; i < std::min(message.name.size(), kMaxNames); ++i) {
    const double q = i < message.position.size() ? message.position[i] : std::nan("");
    const bool has_velocity = message.velocity.size() == message.name.size();
    const double velocity = has_velocity ? message.velocity[i] : std::nan("");
    const auto found = index_.find(message.name[i]);
    if (found == index_.end()) {
      if (unknowns++ == 0) unknown = &message.name[i];
      continue;
    }
    const std::size_t j = found->second;
    const Kinematics::Joint& joint = kinematics_->joints()[j];
    if (!joint.is_free() && joint.source == j) {  // a fixed joint stays in place
      if (joint.has_unstated_pose() && complains) {
        drop("joint '" + joint.name + "' is planar or floating, so its pose must come from tf", 1);
      }
      continue;
    }
    collect_joint(j, q, velocity);
  }
  if (unknowns == 0 || !complains) return;
  const std::string others =
      unknowns > 1 ? ", like " + std::to_string(unknowns - 1) + " others of the message" : "";
  drop("joint '" + *unknown + "' is not in the URDF" + others + ": its position is not used",
       unknowns);
}

/// Reads all positions of a message; returns whether one of them was new.
bool JointStateListener::use_message(const sensor_msgs::JointState& message,
                                     const std::string& publisher) {
  if (message.position.empty()) return false;  // the message holds velocities or efforts alone
  const std::string problem = why_unusable(message);
  collect(message, problem.empty());
  if (!problem.empty()) {
    for (const Stated& one : stated_) refuse(one.joint, problem);
    drop(problem, message.position.size());
    return false;
  }
  const ros::Time stamp = counted_stamp(message.header.stamp);
  std::size_t last = kNowhere;  // the joint that was used before
  std::size_t first = kNowhere;
  for (const Stated& one : stated_) {
    if (!one.fault.empty()) {
      refuse(one.joint, one.fault);
      drop(one.fault, 1);
      continue;
    }
    JointPosition& position = newest_[one.joint];
    // After a publisher whose clock was ahead, one whose clock is right is new all the same.
    const bool was_ahead = position.sent > position.stamp;
    const bool is_newer = was_ahead ? stamp > position.stamp : message.header.stamp > position.sent;
    put_into_tf(one.joint, one.q, stamp, publisher);
    if (!is_newer) continue;
    position.sent = message.header.stamp;
    use(one, stamp, publisher);
    if (first == kNowhere) first = one.joint;
    position.companion = last == kNowhere ? one.joint : last;
    last = one.joint;
  }
  if (first == kNowhere) return false;
  newest_[first].companion = last;
  for (const Stated& one : stated_) {
    if (!kinematics_->joints()[one.joint].is_free()) compare_with_leader(one.joint);
  }
  for (const Stated& one : stated_) newest_[one.joint].is_missing = !one.fault.empty();
  return true;
}

/// The instant from which the age of a message counts; complains about clocks that differ.
ros::Time JointStateListener::counted_stamp(const ros::Time& stamp) {
  const double ahead = seconds_between(last_now_, stamp);
  if (ahead >= kToldSkew) {
    drop(format_text(
             "joint states are stamped %.3f s ahead of the clock: their age counts from their "
             "receipt; compare the clocks",
             ahead),
         0);
  }
  return ahead > kClockResolution ? last_now_ : stamp;
}

void JointStateListener::refuse(std::size_t joint, const std::string& reason) {
  JointPosition& position = newest_[joint];
  if (position.refusal && *position.refusal == reason) return;
  position.refusal = std::make_shared<const std::string>(reason);
}

/// Makes a position the joint's newest one.
void JointStateListener::use(const Stated& stated, const ros::Time& stamp,
                             const std::string& publisher) {
  const Kinematics::Joint& joint = kinematics_->joints()[stated.joint];
  JointPosition& position = newest_[stated.joint];
  if (stated.q < joint.lower - kLimitSlack || stated.q > joint.upper + kLimitSlack) {
    std::ostringstream text;
    text << "joint '" << joint.name << "' is at " << stated.q << ", outside its limits of "
         << joint.lower << " to " << joint.upper << "; it is used all the same";
    drop(text.str(), 0);
  }
  const bool is_later = stamp > position.stamp;
  const double interval = seconds_between(position.stamp, stamp);
  if (position.stamp.isZero() || interval > kMaxSpacing) {
    position.spacing = 0.0;
    position.rate = position.rate_before = std::numeric_limits<double>::quiet_NaN();
  } else if (is_later) {
    position.rate_before = position.rate;
    position.rate = (stated.q - position.q) / interval;
    position.interval_before = std::exchange(position.interval, interval);
    // The longest interval of late, so that one that varies is no alarm.
    position.spacing = std::max(interval, 0.9 * position.spacing + 0.1 * interval);
  }
  position.q = stated.q;
  position.velocity = stated.velocity;
  position.stamp = std::max(position.stamp, stamp);
  position.refusal.reset();
  position.is_missing = false;
  position.is_implausible = is_implausible(joint, stated.q);
  if (is_later) follow(stated.joint, stated.q, stamp, publisher);
}

/// Moves the mimics of a joint that has moved, and theirs, but for those that are stated.
void JointStateListener::follow(std::size_t leader, double q, const ros::Time& stamp,
                                const std::string& publisher) {
  for (const std::size_t j : led_by_[leader]) {
    if (place_[j] != kNowhere) continue;  // the same message states it
    JointPosition& own = newest_[j];
    const bool has_stopped = !own.strays && seconds_between(own.stamp, stamp) > kMaxSpacing;
    if (own.stamp.isZero() || has_stopped) own = JointPosition();
    if (!own.stamp.isZero()) continue;
    const Mimic& mimic = kinematics_->joints()[j].mimic;
    const double q_led = mimic.multiplier * q + mimic.offset;
    put_into_tf(j, q_led, stamp, publisher);
    follow(j, q_led, stamp, publisher);
  }
}

/// Notes whether a mimic joint is where its leader puts it, and tells once that it is not.
void JointStateListener::compare_with_leader(std::size_t joint) {
  JointPosition& own = newest_[joint];
  if (std::isnan(own.q)) return;
  const Kinematics::Joint& at = kinematics_->joints()[joint];
  const double led = at.multiplier * newest_[at.source].q + at.offset;
  const bool strayed = std::exchange(own.strays, !(std::abs(own.q - led) <= kAgreement));
  if (!own.strays || strayed || std::isnan(led)) return;
  drop("joint '" + at.name +
           format_text("' is stated at %.3f, but would be at %.3f as ", own.q, led) +
           "a mimic of joint '" + kinematics_->joints()[at.source].name +
           "'; where it is stated counts",
       0);
}

void JointStateListener::put_into_tf(std::size_t joint, double q, const ros::Time& stamp,
                                     const std::string& publisher) {
  const Kinematics::Joint& at = kinematics_->joints()[joint];
  geometry_msgs::TransformStamped message;
  message.transform = to_message(kinematics_->joint_pose(joint, q));
  message.header.stamp = stamp;
  message.header.frame_id = prefix_ + kinematics_->bodies()[at.parent];
  message.child_frame_id = prefix_ + kinematics_->bodies()[at.child];
  const bool is_static = at.type == JointType::kFixed;
  const std::string problem = buffer_.add(message, publisher, is_static, last_now_);
  if (!problem.empty()) drop(problem, 1);
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
