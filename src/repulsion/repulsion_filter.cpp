#include "ist_proximity/repulsion/repulsion.h"

#include <algorithm>
#include <cmath>

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

RepulsiveWrench RepulsionFilter::update(double time, std::uint64_t obstacles,
                                        const RepulsiveWrench& raw, const LinkProximity& proximity,
                                        const RepulsionConfig& config) {
  Vector6 now;
  now << raw.force, raw.torque;
  if (!now.allFinite() || !(config.filter_time > 0.0)) {
    reset();
    return raw;
  }
  if (started_ && time >= time_) {
    // The change came at some time since the last update; it decays over all of that.
    if (obstacles != obstacles_) offset_ += raw_ - now;
    decay(time - time_, 0.5 * config.filter_time);
  } else {
    reset();
  }
  started_ = true;
  time_ = time;
  obstacles_ = obstacles;
  raw_ = now;
  const double limit = config.gain * std::min(1.0, repulsion_strength(proximity, config) / kFade);
  Vector6 filtered = now + offset_;
  const double length = filtered.head<3>().norm();
  if (length > limit) filtered *= limit / length;
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
