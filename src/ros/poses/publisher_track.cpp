#include "ros/poses/publisher_track.h"

#include "ros/common/ros_time.h"

namespace ist {
namespace {

constexpr double kAgreement = 0.01;     // [m, rad]
constexpr double kAcceleration = 50.0;  // [m/s2, rad/s2] more than robots and people have
constexpr double kMaxInterval = 1.0;    // [s] between two samples of one publisher

/// A quaternion and its negative are the same rotation: gives the one that is nearer to another.
PublisherTrack::Values aligned(PublisherTrack::Values values, const PublisherTrack::Values& other) {
  if (values.tail<4>().dot(other.tail<4>()) < 0.0) values.tail<4>() *= -1.0;
  return values;
}

}  // namespace

bool PublisherTrack::add(const std::string& publisher, const ros::Time& stamp, const Values& values,
                         std::string* other, Values* other_values) {
  std::size_t own = publishers_[0].name == publisher ? 0 : 1;
  if (publishers_[own].name != publisher) {
    own = publishers_[0].samples[0].stamp <= publishers_[1].samples[0].stamp ? 0 : 1;
    publishers_[own] = Publisher();
    publishers_[own].name = publisher;
  }
  Publisher& mine = publishers_[own];
  if (stamp < mine.samples[0].stamp) return false;  // out of order
  mine.samples[1] = mine.samples[0];
  mine.samples[0] = {stamp, values};

  const Publisher& theirs = publishers_[1 - own];
  const Sample &last = mine.samples[0], &before = mine.samples[1];
  for (const Sample& sample : theirs.samples) {
    if (sample.stamp.isZero() || sample.stamp > last.stamp) continue;
    const double after = seconds_between(sample.stamp, last.stamp);
    Values expected = last.values;
    double slack = kAgreement;
    if (after > 0.0) {
      const double interval = seconds_between(before.stamp, last.stamp);
      if (before.stamp.isZero() || before.stamp > sample.stamp || interval > kMaxInterval) continue;
      const double share = after / interval;
      expected = (1.0 - share) * last.values + share * aligned(before.values, last.values);
      slack += 0.5 * kAcceleration * after * (interval - after);
    }
    if ((aligned(sample.values, last.values) - expected).cwiseAbs().maxCoeff() <= slack) continue;
    *other = theirs.name;
    *other_values = sample.values;
    return true;
  }
  return false;
}

}  // namespace ist
