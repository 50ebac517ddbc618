#include "ist_proximity/proximity/closing_speed.h"

#include <algorithm>
#include <cmath>

namespace ist {
namespace {

constexpr double kMaxInterval = 0.2;  // [s] between the poses of the robot's part
constexpr double kBaseline = 0.02;    // [s] a shorter one makes a speed of the encoders' last bits
// [s] Between clouds. What is measured anew in each cycle would fill the estimate in no time.
constexpr double kSpacing = 0.008;

// [m] What two answers to one scene may differ by: rounding, and points within the tolerance.
constexpr double kAnswerNoise = 3e-4;

// Student's t that noise exceeds in 1 of 1000 cases on either side, by degrees of freedom from 2.
constexpr std::array<double, ApproachEstimate::kMost - 3> kSignificant = {
    31.60, 12.92, 8.61, 6.87, 5.96, 5.41, 5.04, 4.78, 4.59, 4.44, 4.32, 4.22, 4.14};

// Sums over values (t, y), for fits of a line and of a level.
struct Sums {
  double n = 0.0, t = 0.0, y = 0.0, tt = 0.0, ty = 0.0, yy = 0.0;

  void add(double at, double value) {
    n += 1.0;
    t += at;
    y += value;
    tt += at * at;
    ty += at * value;
    yy += value * value;
  }
  double s_tt() const { return tt - t * t / n; }
  double s_ty() const { return ty - t * y / n; }
  double s_yy() const { return std::max(yy - y * y / n, 0.0); }
  double slope() const { return s_ty() / s_tt(); }
  // [m^2] Squared residuals of the line.
  double residual_sq() const { return std::max(s_yy() - s_ty() * slope(), 0.0); }
};

// [m^2] Least squared residuals of two levels, the first values at one and the others at another.
double residual_of_step(const double* y, std::size_t n) {
  double all = 0.0, all_sq = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    all += y[i];
    all_sq += y[i] * y[i];
  }
  double best = std::numeric_limits<double>::infinity(), first = 0.0;
  for (std::size_t i = 0; i + 1 < n; ++i) {
    first += y[i];
    const auto k = static_cast<double>(i + 1), rest = static_cast<double>(n - i - 1);
    best = std::min(best, all_sq - first * first / k - (all - first) * (all - first) / rest);
  }
  return std::max(best, 0.0);
}

// [m] The increase of the distance from a standing obstacle to the link's closest point since
// another pose.
double retreat(const LinkProximity& result, const Eigen::Isometry3d& X_FL,
               const Eigen::Isometry3d& X_FL_before) {
  return result.direction.dot(X_FL * result.p_LCl - X_FL_before * result.p_LCl);
}

// @param approached  [m] how far obstacles have come since their cloud
double time_to_contact(const LinkProximity& result, double speed, double approached) {
  if (result.state == LinkState::kContact) return 0.0;
  if (std::isnan(speed)) return ClosingRates::kNaN;
  if (speed < kClosingNoiseFloor) return std::numeric_limits<double>::infinity();
  return std::max(result.lower_bound - approached, 0.0) / speed;
}

}  // namespace

void ApproachEstimate::add(double stamp, double approach) {
  const double interval = stamp - newest_stamp();
  if (count_ > 0 && !(interval > 0.0 && interval <= kMaxGap)) count_ = 0;
  stamps_[next_] = stamp;
  values_[next_] = approach;
  next_ = (next_ + 1) % kMost;
  count_ = std::min(count_ + 1, kMost);
  speed_ = estimate();
}

double ApproachEstimate::newest_stamp() const {
  if (count_ == 0) return -std::numeric_limits<double>::infinity();
  return stamps_[(next_ + kMost - 1) % kMost];
}

double ApproachEstimate::estimate() const {
  if (count_ < kFewest) return ClosingRates::kNaN;
  const std::size_t newest = (next_ + kMost - 1) % kMost;
  std::array<double, kMost> y{};  // the newest first, relative to it
  Sums sums;
  bool has_step = false;
  double speed = ClosingRates::kNaN, half_width = 0.0;  // [m/s] of the best line
  for (std::size_t k = 0; k < count_; ++k) {
    const std::size_t at = (newest + kMost - k) % kMost;
    const double age = stamps_[at] - stamps_[newest];
    if (k >= kFewest && age < -kMaxSpan) break;
    y[k] = values_[at] - values_[newest];
    sums.add(age, y[k]);
    if (k + 1 < kFewest) continue;
    const double noise_sq =
        std::max(sums.residual_sq() / (sums.n - 2.0), kAnswerNoise * kAnswerNoise);
    const double least = kSignificant[k + 1 - kFewest] * std::sqrt(noise_sq / sums.s_tt());
    if (std::abs(sums.slope()) < least) continue;
    if (sums.residual_sq() > residual_of_step(y.data(), k + 1)) {
      has_step = true;
      continue;
    }
    const bool is_first = std::isnan(speed);
    const bool agrees = std::abs(sums.slope() - speed) <= half_width;
    if (!is_first && !(agrees && least < half_width)) continue;
    speed = sums.slope();
    half_width = least;
  }
  if (!std::isnan(speed)) return speed;
  return has_step ? ClosingRates::kNaN : 0.0;
}

const ClosingSpeed::Pose* ClosingSpeed::reference(double time) const {
  const auto is_usable = [time](const Pose& pose) {
    return pose.time < time && time - pose.time < kMaxInterval;
  };
  if (is_usable(older_)) return &older_;
  return is_usable(newer_) ? &newer_ : nullptr;
}

void ClosingSpeed::remember(const Pose& now) {
  latest_ = now;
  if (!(now.time - newer_.time >= kBaseline)) return;
  older_ = newer_;
  newer_ = now;
}

ClosingSpeed::Track* ClosingSpeed::find_track(int source) {
  Track* oldest = &tracks_[0];
  for (Track& track : tracks_) {
    if (track.used > 0 && track.source == source) {
      oldest = &track;
      break;
    }
    if (track.used < oldest->used) oldest = &track;
  }
  if (oldest->used == 0 || oldest->source != source) {
    *oldest = Track();
    oldest->source = source;
  }
  oldest->used = ++uses_;
  return oldest;
}

double ClosingSpeed::obstacle_speed(const Pose& now, const LinkProximity& result,
                                    const Nearest& nearest) {
  const bool is_first = !std::isfinite(latest_.time);
  const bool same_cloud =
      !is_first && latest_source_ == nearest.source && latest_generation_ == nearest.generation;
  // Within one cloud the robot alone changes the distance.
  if (same_cloud) retreat_ += now.distance - latest_.distance;
  if (!same_cloud && !is_first) retreat_ += retreat(result, now.X_FL, latest_.X_FL);
  latest_source_ = nearest.source;
  latest_generation_ = nearest.generation;

  Track* track = find_track(nearest.source);
  const double since = nearest.stamp - track->approach.newest_stamp();  // infinite at first
  const bool is_too_soon = since > 0.0 && since < kSpacing;
  if (std::isinf(since) || (track->generation != nearest.generation && !is_too_soon)) {
    track->generation = nearest.generation;
    track->approach.add(nearest.stamp, retreat_ - now.distance);
  }
  const double speed = track->approach.speed();
  return nearest.stands_still ? 0.0 : speed;
}

ClosingRates ClosingSpeed::update(double time, const LinkProximity& result,
                                  const Eigen::Isometry3d& X_FL, const Nearest& nearest) {
  if (result.state < LinkState::kNear || time < latest_.time) {
    *this = ClosingSpeed();
    if (result.state < LinkState::kNear) return {};
  }
  const Pose now{time, X_FL, result.distance};
  ClosingRates rates;
  rates.obstacles = obstacle_speed(now, result, nearest);
  if (const Pose* before = reference(time)) {
    rates.robot = -retreat(result, X_FL, before->X_FL) / (time - before->time);
    rates.total = rates.robot + rates.obstacles;
  }
  const double age = std::max(time - nearest.stamp, 0.0);
  rates.time_to_contact = time_to_contact(result, rates.total, rates.obstacles * age);
  remember(now);
  return rates;
}

ClosingRates ClosingSpeed::update_pair(double time, const LinkProximity& result) {
  if (result.state < LinkState::kNear || time < latest_.time) {
    *this = ClosingSpeed();
    if (result.state < LinkState::kNear) return {};
  }
  ClosingRates rates;
  if (const Pose* before = reference(time)) {
    rates.total = (before->distance - result.distance) / (time - before->time);
  }
  rates.time_to_contact = time_to_contact(result, rates.total, 0.0);
  remember({time, Eigen::Isometry3d::Identity(), result.distance});
  return rates;
}

}  // namespace ist
