#include "ros/output/closing_speed.h"

#include <algorithm>
#include <cmath>

#include "ros/common/ros_time.h"

namespace ist {
namespace {

constexpr double kMaxInterval = 0.2;       // [s]
constexpr double kMaxCloudInterval = 2.0;  // [s]

/// The increase [m] of the distance from a standing obstacle to the link's witness since another
/// pose.
double retreat(const LinkProximity& result, const Eigen::Isometry3d& X_FL,
               const Eigen::Isometry3d& X_FL_before) {
  return result.direction.dot(X_FL * result.p_LCl - X_FL_before * result.p_LCl);
}

double time_to_contact(const LinkProximity& result, double speed) {
  if (result.state == LinkState::kContact) return 0.0;
  if (std::isnan(speed)) return ClosingRates::kNaN;
  if (speed <= 0.0) return std::numeric_limits<double>::infinity();
  return std::max(result.lower_bound, 0.0) / speed;
}

}  // namespace

ClosingRates ClosingSpeed::update(const ros::Time& stamp, const LinkProximity& result,
                                  const Eigen::Isometry3d& X_FL, const Nearest& nearest) {
  if (result.state < LinkState::kNear) {
    *this = ClosingSpeed();
    return {};
  }
  const Sample now{stamp, result.distance, X_FL, nearest};
  update_obstacles(result, now);
  // Several answers for one instant are compared with the same earlier instant.
  if (stamp != latest_.stamp) previous_ = latest_;
  latest_ = now;

  ClosingRates rates;
  rates.obstacles = obstacles_;
  const double interval = seconds_between(previous_.stamp, stamp);
  if (!previous_.stamp.isZero() && interval > 0.0 && interval < kMaxInterval) {
    rates.robot = -retreat(result, X_FL, previous_.X_FL) / interval;
    rates.total = std::isnan(rates.obstacles) ? (previous_.distance - result.distance) / interval
                                              : rates.robot + rates.obstacles;
  }
  rates.time_to_contact = time_to_contact(result, rates.total);
  return rates;
}

void ClosingSpeed::update_obstacles(const LinkProximity& result, const Sample& now) {
  if (latest_.nearest.source != now.nearest.source) {
    obstacles_ = ClosingRates::kNaN;
  } else if (latest_.nearest.generation != now.nearest.generation) {
    const double interval = now.nearest.stamp - latest_.nearest.stamp;
    const double expected = latest_.distance + retreat(result, now.X_FL, latest_.X_FL);
    const bool usable = interval > 0.0 && interval <= kMaxCloudInterval;
    obstacles_ = usable ? (expected - now.distance) / interval : ClosingRates::kNaN;
  }
}

}  // namespace ist
