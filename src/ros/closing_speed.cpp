#include "ist_proximity/ros/closing_speed.h"

#include <cmath>

#include "ist_proximity/ros/ros_time.h"

namespace ist {
namespace {

constexpr double kMaxInterval = 0.2;  // [s]

}  // namespace

double ClosingSpeed::update(const ros::Time& stamp, double distance) {
  // Asked more often than poses come: the answer before stays the one to compare with.
  if (stamp != latest_.stamp) previous_ = latest_;
  latest_ = {stamp, std::isfinite(distance) ? distance : std::numeric_limits<double>::quiet_NaN()};
  const double interval = seconds_between(previous_.stamp, stamp);
  if (previous_.stamp.isZero() || interval <= 0.0 || interval >= kMaxInterval) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return (previous_.distance - latest_.distance) / interval;
}

}  // namespace ist
