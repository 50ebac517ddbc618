#include "ros/poses/publisher_track.h"

#include <algorithm>

#include "ros/common/ros_time.h"

namespace ist {
namespace {

constexpr double kSamePlace = 0.01;       // [m, rad]
constexpr double kAcceleration = 50.0;    // [m/s2, rad/s2] more than robots and people have
constexpr double kMaxInterval = 1.0;      // [s] between two samples of one publisher
constexpr double kForgottenAfter = 10.0;  // [s] after which a publisher is forgotten for a new one

/// A quaternion and its negative are the same rotation: gives the one that is nearer to another.
PublisherTrack::Values aligned(PublisherTrack::Values values, const PublisherTrack::Values& other) {
  if (values.tail<4>().dot(other.tail<4>()) < 0.0) values.tail<4>() *= -1.0;
  return values;
}

bool differs(const PublisherTrack::Values& values, const PublisherTrack::Values& other,
             double slack) {
  return (aligned(values, other) - other).cwiseAbs().maxCoeff() > slack;
}

}  // namespace

/// Whether a sample of another publisher differs from what the newest samples of one say of its
/// instant.
bool PublisherTrack::disagrees(const Publisher& mine, const Sample& sample) {
  const Sample &last = mine.samples[0], &before = mine.samples[1];
  if (sample.stamp.isZero() || sample.stamp > last.stamp) return false;
  if (sample.stamp == last.stamp) return differs(sample.values, last.values, kSamePlace);
  const double after = seconds_between(sample.stamp, last.stamp);
  const double interval = seconds_between(before.stamp, last.stamp);
  if (!before.stamp.isZero() && before.stamp <= sample.stamp && interval <= kMaxInterval) {
    const double share = after / interval;
    const Values expected =
        (1.0 - share) * last.values + share * aligned(before.values, last.values);
    return differs(sample.values, expected,
                   kSamePlace + 0.5 * kAcceleration * after * (interval - after));
  }
  if (sample.stamp < mine.stays.stamp || std::max(after, mine.longest) > kMaxInterval) return false;
  const double excursion = 0.125 * kAcceleration * mine.longest * mine.longest;
  return differs(sample.values, last.values, 2.0 * kSamePlace + excursion);
}

bool PublisherTrack::add(const std::string& publisher, const ros::Time& stamp, const Values& values,
                         std::string* other, Values* other_values) {
  auto own = std::find_if(publishers_.begin(), publishers_.end(),
                          [&](const Publisher& one) { return one.name == publisher; });
  if (own == publishers_.end()) {
    const auto is_silent = [&](const Publisher& one) {
      return seconds_between(one.samples[0].stamp, stamp) > kForgottenAfter;
    };
    publishers_.erase(std::remove_if(publishers_.begin(), publishers_.end(), is_silent),
                      publishers_.end());
    publishers_.emplace_back();
    own = std::prev(publishers_.end());
    own->name = publisher;
  }
  if (stamp < own->samples[0].stamp) return false;  // out of order
  if (own->stays.stamp.isZero() || differs(values, own->stays.values, kSamePlace)) {
    own->stays = {stamp, values};
    own->longest = 0.0;
  } else {
    own->longest = std::max(own->longest, seconds_between(own->samples[0].stamp, stamp));
  }
  own->samples[1] = own->samples[0];
  own->samples[0] = {stamp, values};
  for (const Publisher& theirs : publishers_) {
    if (&theirs == &*own) continue;
    for (const Sample& sample : theirs.samples) {
      if (!disagrees(*own, sample)) continue;
      *other = theirs.name;
      *other_values = sample.values;
      return true;
    }
  }
  return false;
}

}  // namespace ist
