#include "ros/filter/joint_history.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/numbers.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kKept = 1.0;  // [s] more than an answer's age may be

}  // namespace

JointHistory::JointHistory(std::shared_ptr<const Kinematics> kinematics)
    : kinematics_(std::move(kinematics)) {
  clear();
}

void JointHistory::clear() {
  q_.assign(kinematics_->joints().size(), kNaN);
  stamp_.assign(q_.size(), ros::Time());
  samples_.clear();
}

void JointHistory::add(const sensor_msgs::JointState& message, const ros::Time& now) {
  const double ahead = seconds_between(now, message.header.stamp);
  if (message.position.size() != message.name.size() || message.header.stamp.isZero() ||
      ahead > kMaxAhead) {
    return;
  }
  const ros::Time& stamp = ahead > kClockResolution ? now : message.header.stamp;
  bool is_new = false;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    const auto joint = kinematics_->find_joint(message.name[i]);
    if (!joint || !std::isfinite(message.position[i]) || stamp < stamp_[*joint]) continue;
    q_[*joint] = message.position[i];
    stamp_[*joint] = stamp;
    is_new = true;
  }
  if (!is_new || (!samples_.empty() && stamp < samples_.back().stamp)) return;
  if (!samples_.empty() && stamp == samples_.back().stamp) {
    samples_.back().q = q_;
  } else {
    samples_.push_back({stamp, q_});
  }
  while (seconds_between(samples_.front().stamp, stamp) > kKept) samples_.pop_front();
}

bool JointHistory::at(const ros::Time& stamp, std::vector<double>* q) const {
  const auto after =
      std::lower_bound(samples_.begin(), samples_.end(), stamp,
                       [](const Sample& sample, const ros::Time& t) { return sample.stamp < t; });
  if (after == samples_.end()) {
    *q = q_;
    return !samples_.empty();
  }
  *q = after->q;
  if (after->stamp == stamp) return true;
  if (after == samples_.begin()) return false;
  const Sample& before = *(after - 1);
  const double share =
      seconds_between(before.stamp, stamp) / seconds_between(before.stamp, after->stamp);
  for (std::size_t j = 0; j < q->size(); ++j) {
    (*q)[j] = before.q[j] + share * (after->q[j] - before.q[j]);
  }
  return true;
}

double JointHistory::velocity(std::size_t joint, double window) const {
  const ros::Time& newest = stamp_[joint];
  for (auto sample = samples_.rbegin(); sample != samples_.rend(); ++sample) {
    const double passed = seconds_between(sample->stamp, newest);
    if (passed >= window) return (q_[joint] - sample->q[joint]) / passed;
  }
  return kNaN;
}

double JointHistory::age(const ros::Time& now) const {
  double oldest = 0.0;
  for (std::size_t j = 0; j < q_.size(); ++j) {
    if (kinematics_->joints()[j].is_free()) {
      oldest = std::max(oldest, seconds_between(stamp_[j], now));
    }
  }
  return oldest;
}

std::string JointHistory::late_joint(const ros::Time& now, double timeout) const {
  const auto& joints = kinematics_->joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const bool is_stated_mimic = joints[j].source != j && !std::isnan(q_[j]);
    if (!joints[j].is_free() && !is_stated_mimic) continue;
    if (std::isnan(q_[j])) return "no position of joint '" + joints[j].name + "' has been stated";
    const double age = seconds_between(stamp_[j], now);
    if (age > timeout) {
      return format_text("the position of joint '%s' is %.2f s old; ~joint_timeout is %g s",
                         joints[j].name.c_str(), age, timeout);
    }
  }
  return "";
}

}  // namespace ist
