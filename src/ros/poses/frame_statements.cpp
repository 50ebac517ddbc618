#include "ros/poses/frame_statements.h"

#include <algorithm>
#include <cmath>

#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kSamePlace = 0.01;     // [m, quaternion]
constexpr double kAcceleration = 50.0;  // [m/s2, rad/s2] more than robots and people have
constexpr double kMaxInterval = 1.0;    // [s] between two samples of one publisher
// Where a static transform is stated twice, the numbers differ by their rounding only. [m, rad]
constexpr double kRounding = 1e-3;
// [s] A publisher that has been silent for so long has stopped: less than three periods for none.
constexpr double kSilence = 1.0, kUnknownSilence = 3.0, kMaxSilence = 10.0;
constexpr double kSilentPeriods = 3.0;

}  // namespace

FrameStatements::Place FrameStatements::place_of(const geometry_msgs::Transform& transform) {
  const auto& p = transform.translation;
  const auto& q = transform.rotation;
  Place place;
  place << p.x, p.y, p.z, q.x, q.y, q.z, q.w;
  return place;
}

/// Whether two places are more than `slack` apart; a quaternion and its negative are one rotation.
bool FrameStatements::differs(const Place& place, const Place& other, double slack) {
  Place difference = place - other;
  if (place.tail<4>().dot(other.tail<4>()) < 0.0) {
    difference.tail<4>() = place.tail<4>() + other.tail<4>();
  }
  return difference.cwiseAbs().maxCoeff() > slack;
}

/// Whether a sample of another publisher differs from what the newest samples of one say of its
/// instant.
bool FrameStatements::disagrees(const Statement& mine, const Sample& sample) {
  const Sample &last = mine.samples[0], &before = mine.samples[1];
  if (sample.stamp.isZero() || sample.stamp > last.stamp) return false;
  if (sample.stamp == last.stamp) return differs(sample.place, last.place, kSamePlace);
  const double after = seconds_between(sample.stamp, last.stamp);
  const double interval = seconds_between(before.stamp, last.stamp);
  if (!before.stamp.isZero() && before.stamp <= sample.stamp && interval <= kMaxInterval) {
    Place start = before.place;
    if (start.tail<4>().dot(last.place.tail<4>()) < 0.0) start.tail<4>() *= -1.0;
    const double share = after / interval;
    return differs(sample.place, (1.0 - share) * last.place + share * start,
                   kSamePlace + 0.5 * kAcceleration * after * (interval - after));
  }
  if (sample.stamp < mine.stays.stamp || std::max(after, mine.longest) > kMaxInterval) return false;
  const double excursion = 0.125 * kAcceleration * mine.longest * mine.longest;
  return differs(sample.place, last.place, 2.0 * kSamePlace + excursion);
}

void FrameStatements::note_motion(const Sample& sample, const ros::Time& now,
                                  Statement* own) const {
  if (sample.stamp < own->samples[0].stamp) return;  // out of order
  if (own->stays.stamp.isZero() || differs(sample.place, own->stays.place, kSamePlace)) {
    own->stays = sample;
    own->longest = 0.0;
  } else {
    own->longest = std::max(own->longest, seconds_between(own->samples[0].stamp, sample.stamp));
  }
  own->samples = {sample, own->samples[0]};
  for (const Statement& other : statements_) {
    if (&other == own || std::none_of(other.samples.begin(), other.samples.end(),
                                      [&](const Sample& one) { return disagrees(*own, one); })) {
      continue;
    }
    own->rival = other.publisher.name;
    const ros::Duration silence(std::max(own->silence, other.silence));
    own->rival_until = std::max(own->rival_until, now + silence);
    return;
  }
}

void FrameStatements::add(const geometry_msgs::TransformStamped& transform,
                          const TransformPublisher& publisher, bool is_static,
                          const ros::Time& now) {
  auto own = std::find_if(statements_.begin(), statements_.end(), [&](const Statement& one) {
    return one.publisher.name == publisher.name;
  });
  double silence = kUnknownSilence;
  if (own == statements_.end()) {
    own = statements_.insert(own, Statement(publisher));
  } else if (!own->is_static) {
    const double period = seconds_between(own->received, now);
    silence = std::clamp(kSilentPeriods * period, kSilence, kMaxSilence);
  }
  own->publisher = publisher;
  own->is_static = is_static;
  own->transform = transform;
  own->received = now;
  own->silence = silence;
  if (!is_static) note_motion({transform.header.stamp, place_of(transform.transform)}, now, &*own);
  if (statements_.size() > 1) decide(now);
}

void FrameStatements::withdraw(const std::string& publisher) {
  statements_.erase(
      std::remove_if(statements_.begin(), statements_.end(),
                     [&](const Statement& one) { return one.publisher.name == publisher; }),
      statements_.end());
}

void FrameStatements::forget_moving() {
  std::vector<Statement> kept;
  for (const Statement& one : statements_) {
    if (!one.is_static) continue;
    kept.emplace_back(one.publisher);
    kept.back().is_static = true;
    kept.back().transform = one.transform;
  }
  statements_ = std::move(kept);
}

std::vector<geometry_msgs::TransformStamped> FrameStatements::statics() const {
  std::vector<geometry_msgs::TransformStamped> transforms;
  for (const Statement& one : statements_) {
    if (one.is_static) transforms.push_back(one.transform);
  }
  return transforms;
}

std::string FrameStatements::why_disagreeing(const Statement& a, const Statement& b,
                                             const ros::Time& now) {
  const std::string child = without_slash(a.transform.child_frame_id);
  const std::string parent_a = without_slash(a.transform.header.frame_id);
  const std::string parent_b = without_slash(b.transform.header.frame_id);
  const std::string names = a.publisher.name + " and " + b.publisher.name;
  if (parent_a != parent_b) {
    return "frame '" + child + "' has two publishers that disagree, " + names +
           ": its parent is '" + parent_a + "' or '" + parent_b + "'";
  }
  const Place place_a = place_of(a.transform.transform), place_b = place_of(b.transform.transform);
  const double distance = (place_a - place_b).head<3>().norm();
  const double cosine = std::min(1.0, std::abs(place_a.tail<4>().dot(place_b.tail<4>())));
  const double angle = 2.0 * std::acos(cosine);
  const bool are_rivals = (a.rival == b.publisher.name && now < a.rival_until) ||
                          (b.rival == a.publisher.name && now < b.rival_until);
  const bool is_static = a.is_static || b.is_static;
  if (!are_rivals && !(is_static && std::max(distance, angle) > kRounding)) return "";
  return "the transform from '" + child + "' to '" + parent_a +
         "' has two publishers that disagree, " + names +
         format_text(": they are %.3f m apart", distance) +
         (angle > kRounding ? format_text(" and turned by %.2f deg", angle * 180.0 / M_PI) : "");
}

void FrameStatements::decide(const ros::Time& now) {
  const auto is_over = [&](const Statement& one) {
    return one.is_static ? one.publisher.is_gone()
                         : seconds_between(one.received, now) > one.silence;
  };
  if (std::all_of(statements_.begin(), statements_.end(), is_over)) {
    // What came last is what tf has.
    const auto last = std::max_element(
        statements_.begin(), statements_.end(),
        [](const Statement& x, const Statement& y) { return x.received < y.received; });
    if (last != statements_.end()) statements_ = {Statement(*last)};
  } else {
    statements_.erase(std::remove_if(statements_.begin(), statements_.end(), is_over),
                      statements_.end());
  }
  std::string dispute;
  for (auto b = statements_.begin(); b != statements_.end() && dispute.empty(); ++b) {
    for (auto a = statements_.begin(); a != b && dispute.empty(); ++a) {
      dispute = why_disagreeing(*a, *b, now);
    }
  }
  // The numbers of a dispute that lasts stay those of its beginning, so that its text does.
  if (dispute.empty() == dispute_.empty()) return;
  if (!dispute.empty()) dispute += format_text(", since %.1f s; stop one of them", now.toSec());
  dispute_ = dispute;
}

}  // namespace ist
