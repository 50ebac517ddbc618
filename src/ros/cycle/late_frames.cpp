#include "ros/cycle/late_frames.h"

#include <algorithm>

#include "ros/common/text.h"

namespace ist {
namespace {

constexpr double kMostTurned = 0.5;  // [rad] in the age of a pose

double turn_of(const Eigen::Isometry3d& moved) { return Eigen::AngleAxisd(moved.linear()).angle(); }

/// [rad] How far a frame may have turned.
double turn_of(const Lag& lag) {
  double most = 0.0;
  for (const Eigen::Isometry3d& moved : lag.moves()) most = std::max(most, turn_of(moved));
  return turn_of(lag.apart) + lag.age / lag.window * most;
}

/// [m] How far a motion takes what is within a sphere.
double way_of(const Eigen::Isometry3d& moved, const Eigen::Vector3d& center, double radius) {
  return (moved * center - center).norm() + turn_of(moved) * radius;
}

/// [m] How far what stands in a frame may be from where it is taken to be.
double way_of(const Lag& lag, const Eigen::Vector3d& center, double radius) {
  const double apart = way_of(lag.apart, center, radius);
  double most = 0.0;
  for (const Eigen::Isometry3d& moved : lag.moves()) {
    most = std::max(most, way_of(moved, center, radius + apart));
  }
  return apart + lag.age / lag.window * most;
}

}  // namespace

void LateFrames::begin() {
  lags_.clear();
  links_ = {};
  most_ = 0.0;
  latest_ = nullptr;
}

void LateFrames::add(const Lag& lag) {
  if (lag.windows > 0 || !lag.apart.matrix().isIdentity(0.0)) lags_.push_back(&lag);
}

/// [m] How much nearer to a link an obstacle may have come that is `bound` from it.
double LateFrames::shift(std::size_t link, double bound, const Lag** lag) const {
  const InnerSphereTree& tree = robot_.links[link].tree;
  return within(X_FL_[link] * tree.center(), tree.radius() + std::max(bound, 0.0), lag) +
         (links_.empty() ? 0.0 : links_[link]);
}

double LateFrames::range(double max_distance) const {
  double farthest = max_distance, turn = 0.0;
  if (lags_.empty() && links_.empty()) return farthest;
  for (const Lag* lag : lags_) turn = std::max(turn, turn_of(*lag));
  for (std::size_t i = 0; i < known_.size(); ++i) {
    if (!known_[i] || !robot_.links[i].usable()) continue;
    // What is farther away moves more where its frame turns.
    const double first = shift(i, max_distance, nullptr);
    farthest = std::max(farthest, max_distance + first / (1.0 - std::min(turn, kMostTurned)));
  }
  return farthest;
}

void LateFrames::lower(double max_distance, std::vector<LinkProximity>* answers) {
  if (lags_.empty() && links_.empty()) return;
  for (std::size_t i = 0; i < answers->size(); ++i) {
    LinkProximity& answer = (*answers)[i];
    if (answer.state == LinkState::kUnknown) continue;
    const Lag* lag = nullptr;
    const double off = shift(i, answer.lower_bound, &lag);
    answer.lower_bound -= off;
    if (answer.state == LinkState::kClear) {
      // range() falls short of it only where a frame turns more than kMostTurned.
      const bool is_clear = answer.lower_bound >= max_distance * (1.0 - 1e-12);
      if (is_clear) answer.lower_bound = std::max(answer.lower_bound, max_distance);
      if (!is_clear) answer.reset();
    } else {
      answer.sensor_width += off;
    }
    if (lag == nullptr || off <= most_) continue;
    most_ = off;
    latest_ = lag;
  }
}

double LateFrames::within(const Eigen::Vector3d& center, double radius, const Lag** lag) const {
  double most = 0.0;
  for (const Lag* one : lags_) {
    const double there = way_of(*one, center, radius);
    if (there <= most) continue;
    most = there;
    if (lag) *lag = one;
  }
  return most;
}

std::string LateFrames::doubt(double tolerance) const {
  if (!latest_ || most_ <= tolerance) return "";
  return "the newest pose of frame '" + latest_->frame +
         format_text(
             "' is %.3f s older than the links': in that time what stands in it moves up to ",
             latest_->age) +
         format_text("%.1f mm, which is taken off the bounds", 1e3 * most_);
}

}  // namespace ist
