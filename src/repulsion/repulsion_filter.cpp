#include "ist_proximity/repulsion/repulsion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ist {
namespace {

// The length fades to zero over this share of the influence distance.
constexpr double kFade = 0.1;

}  // namespace

// The exact solution of o'' + 2 o' / lag + o / lag^2 = 0.
void RepulsionFilter::decay(double seconds, double lag) {
  const double rest = std::exp(-seconds / lag);
  const Vector6 slope = speed_ + offset_ / lag;
  offset_ = rest * (offset_ + seconds * slope);
  speed_ = rest * slope - offset_ / lag;
}

void RepulsionFilter::hold(double time, double length, const Eigen::Isometry3d& X_FL,
                           const Vector6& wrench) {
  const Eigen::Matrix3d R_LF = X_FL.linear().transpose();
  held_per_length_ << R_LF * wrench.head<3>(), R_LF * wrench.tail<3>();
  held_per_length_ /= length;  // NaN where nothing is near: there is no direction to hold
  hold_begin_ = time;
  is_let_go_ = false;
}

// The wrench that was blended last, turned with the link; NaN where it is let go.
RepulsionFilter::Vector6 RepulsionFilter::held(double time, double length,
                                               const Eigen::Isometry3d& X_FL,
                                               const LinkProximity& proximity,
                                               const RepulsionConfig& config) {
  if (length == 0.0) return Vector6::Zero();
  if (!is_let_go_ && !held_per_length_.allFinite()) {
    const RepulsiveWrench nearest = nearest_repulsion(X_FL, proximity, config);
    Vector6 wrench;
    wrench << nearest.force, nearest.torque;
    hold(time, length, X_FL, wrench);
  }
  Vector6 wrench = Vector6::Constant(std::numeric_limits<double>::quiet_NaN());
  is_let_go_ = is_let_go_ || time - hold_begin_ > kHoldTime;
  if (is_let_go_) return wrench;
  wrench << X_FL.linear() * held_per_length_.head<3>(), X_FL.linear() * held_per_length_.tail<3>();
  return length * wrench;
}

RepulsiveWrench RepulsionFilter::update(double time, std::uint64_t obstacles,
                                        const RepulsiveWrench& raw, const LinkProximity& proximity,
                                        const RepulsionConfig& config,
                                        const Eigen::Isometry3d& X_FL) {
  if (!(time >= time_)) reset();
  const double length = config.gain * repulsion_strength(proximity, config);
  Vector6 now;
  now << raw.force, raw.torque;
  const bool is_late = proximity.state != LinkState::kUnknown && !now.allFinite();
  if (is_late) now = held(time, length, X_FL, proximity, config);
  if (!now.allFinite()) {
    const bool is_let_go = is_let_go_ && is_late;
    reset();
    is_let_go_ = is_let_go;
    return RepulsiveWrench::unknown();
  }
  if (!is_late) hold(time, length, X_FL, now);
  if (!(config.filter_time > 0.0)) {
    offset_.setZero();
    speed_.setZero();
  } else if (started_) {
    // The change came at some time since the last update; it decays over all of that.
    if (obstacles != obstacles_ || (is_late_ && !is_late)) offset_ += raw_ - now;
    decay(time - time_, 0.5 * config.filter_time);
  }
  started_ = true;
  is_late_ = is_late;
  time_ = time;
  obstacles_ = obstacles;
  raw_ = now;
  if (!(config.filter_time > 0.0)) return {now.head<3>(), now.tail<3>()};
  const double limit = config.gain * std::min(1.0, repulsion_strength(proximity, config) / kFade);
  Vector6 filtered = now + offset_;
  const double filtered_length = filtered.head<3>().norm();
  if (filtered_length > limit) filtered *= limit / filtered_length;
  if (limit == 0.0) {  // the next update starts without an offset, too
    filtered.setZero();
    offset_.setZero();
    speed_.setZero();
  }
  return {filtered.head<3>(), filtered.tail<3>()};
}

std::uint64_t obstacles_key(SnapshotSpan clouds) {
  std::uint64_t key = 1469598103934665603ULL;  // FNV-1a, by words
  const auto mix = [&key](std::uint64_t value) { key = (key ^ value) * 1099511628211ULL; };
  for (const CloudSnapshot* cloud : clouds) {
    mix(cloud != nullptr ? cloud->index.build_id() : 0);
    mix(cloud != nullptr && cloud->boxes ? cloud->boxes->build_id() : 0);
  }
  return key;
}

}  // namespace ist
