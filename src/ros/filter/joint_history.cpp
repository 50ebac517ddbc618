#include "ros/filter/joint_history.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/numbers.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/poses/joint_lag.h"

namespace ist {
namespace {

constexpr double kKept = 1.0 + kMaxAhead;  // [s] more than an answer's age may be
constexpr auto is_before = [](const auto& sample, const ros::Time& t) { return sample.stamp < t; };

}  // namespace

JointHistory::JointHistory(std::shared_ptr<const Kinematics> kinematics)
    : kinematics_(std::move(kinematics)) {
  clear();
}

void JointHistory::clear() {
  samples_.clear();
  samples_.resize(kinematics_->joints().size());
  disputed_.assign(samples_.size(), 0);
  any_ahead_ = false;
}

void JointHistory::add(const sensor_msgs::JointState& message, const ros::Time& now) {
  const double ahead = seconds_between(now, message.header.stamp);
  if (message.position.size() != message.name.size() || message.header.stamp.isZero() ||
      ahead > kMaxAhead) {
    return;
  }
  const ros::Time& sent = message.header.stamp;
  const bool is_ahead = ahead > kClockResolution;
  any_ahead_ = any_ahead_ || is_ahead;
  ++messages_;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    const auto joint = kinematics_->find_joint(message.name[i]);
    if (!joint || !std::isfinite(message.position[i])) continue;
    Samples& samples = samples_[*joint];
    if (!samples.empty() && samples.back().message == messages_ &&
        samples.back().q != message.position[i]) {
      samples.pop_back();
      disputed_[*joint] = messages_;
    }
    if (disputed_[*joint] == messages_) continue;
    append({is_ahead ? now : sent, sent, message.position[i], messages_}, &samples);
  }
}

/// Adds the sample of a joint, unless it is older than the last one, and drops what is older than
/// kKept.
void JointHistory::append(Sample sample, Samples* samples) {
  if (!samples->empty()) {
    // After a publisher whose clock was ahead, one whose clock is right is new all the same.
    const Sample& last = samples->back();
    const bool was_ahead = last.sent > last.stamp;
    if (sample.sent < last.sent && (!was_ahead || sample.stamp < last.stamp)) return;
    sample.stamp = std::max(sample.stamp, last.stamp);
    // While the clock stands, the first one is what a node may have answered for.
    const std::size_t count = samples->size();
    if (count > 1 && sample.sent == (*samples)[count - 2].sent) samples->pop_back();
  }
  samples->push_back(sample);
  while (samples->size() > 1 && seconds_between((*samples)[1].stamp, sample.stamp) > kKept) {
    samples->pop_front();
  }
}

/// Whether all joints that are stated at an instant come in one message: of several, a node answers
/// each.
bool JointHistory::is_of_one_message(const ros::Time& stamp) const {
  std::uint64_t message = 0;
  for (const Samples& samples : samples_) {
    const auto at = std::lower_bound(samples.begin(), samples.end(), stamp, is_before);
    if (at == samples.end() || at->stamp != stamp) continue;
    if (message != 0 && at->message != message) return false;
    message = at->message;
  }
  return true;
}

bool JointHistory::at(const ros::Time& stamp, std::vector<double>* q,
                      std::vector<double>* moved) const {
  q->assign(samples_.size(), kNaN);
  if (moved) moved->assign(samples_.size(), kNaN);
  const bool is_one = moved && is_of_one_message(stamp);
  for (std::size_t j = 0; j < samples_.size(); ++j) {
    const Samples& samples = samples_[j];
    if (samples.empty()) continue;
    const auto after = std::lower_bound(samples.begin(), samples.end(), stamp, is_before);
    const bool is_stated = after != samples.end() && after->stamp == stamp;
    if (after == samples.end()) {
      (*q)[j] = samples.back().q;
    } else if (is_stated) {
      (*q)[j] = after->q;
    } else if (after == samples.begin()) {
      return false;
    } else {
      const Sample& before = *(after - 1);
      const double share =
          seconds_between(before.stamp, stamp) / seconds_between(before.stamp, after->stamp);
      (*q)[j] = before.q + share * (after->q - before.q);
    }
    if (!moved) continue;
    (*moved)[j] = std::abs(samples.back().q - (*q)[j]);
    if (any_ahead_ && !note_ahead(samples, stamp, &(*moved)[j])) return false;
    if (is_stated && is_one) continue;
    const auto oldest = std::lower_bound(samples.begin(), after, stamp,
                                         [](const Sample& sample, const ros::Time& t) {
                                           return seconds_between(sample.stamp, t) > kLag;
                                         });
    for (auto held = after; held != samples.begin() && oldest - held < kHeldIntervals;) {
      --held;
      (*moved)[j] = std::max((*moved)[j], std::abs(samples.back().q - held->q));
    }
  }
  return true;
}

/// Whoever takes stamps of a clock that is ahead as they are has an older position for present.
/// @param moved  becomes as large as the way since any that may be meant
/// @returns false where the history does not reach back so far
bool JointHistory::note_ahead(const Samples& samples, const ros::Time& stamp, double* moved) const {
  auto sample = samples.rbegin();
  bool is_ahead = false;
  for (; sample != samples.rend() && (sample->sent > stamp || sample->stamp > stamp); ++sample) {
    is_ahead = is_ahead || sample->sent > sample->stamp;
    *moved = std::max(*moved, std::abs(samples.back().q - sample->q));
  }
  if (sample == samples.rend()) return !is_ahead;
  *moved = std::max(*moved, std::abs(samples.back().q - sample->q));
  return true;
}

double JointHistory::newest(std::size_t joint) const {
  return samples_[joint].empty() ? kNaN : samples_[joint].back().q;
}

double JointHistory::velocity(std::size_t joint, double window) const {
  const Samples& samples = samples_[joint];
  for (auto sample = samples.rbegin(); sample != samples.rend(); ++sample) {
    const double passed = seconds_between(sample->stamp, samples.back().stamp);
    if (passed >= window) return (samples.back().q - sample->q) / passed;
  }
  return kNaN;
}

/// Whether it has a position of its own, or is a mimic joint that is stated.
bool JointHistory::is_needed(std::size_t joint) const {
  const Kinematics::Joint& at = kinematics_->joints()[joint];
  return at.is_free() || (at.source != joint && !samples_[joint].empty());
}

double JointHistory::age(const ros::Time& now) const {
  double oldest = 0.0;
  for (std::size_t j = 0; j < samples_.size(); ++j) {
    if (!is_needed(j)) continue;
    if (samples_[j].empty()) return kInfinity;
    oldest = std::max(oldest, seconds_between(samples_[j].back().stamp, now));
  }
  return oldest;
}

std::string JointHistory::late_joint(const ros::Time& now, double timeout) const {
  const auto& joints = kinematics_->joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Samples& samples = samples_[j];
    if (!is_needed(j)) continue;
    if (samples.empty()) return "no position of joint '" + joints[j].name + "' has been stated";
    const double age = seconds_between(samples.back().stamp, now);
    if (age > timeout) {
      return format_text("the position of joint '%s' is %.2f s old; ~joint_timeout is %g s",
                         joints[j].name.c_str(), age, timeout);
    }
  }
  return "";
}

}  // namespace ist
