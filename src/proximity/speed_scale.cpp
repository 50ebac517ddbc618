#include "ist_proximity/proximity/speed_scale.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// [m/s] A walking person (ISO 13855), assumed at least while obstacles' speed is not known.
constexpr double kWalkingSpeed = 1.6;

std::string text_of(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

/// Collects the sentences of config_errors().
class ConfigCheck {
 public:
  explicit ConfigCheck(std::string prefix) : prefix_(std::move(prefix)) {}

  /// Checks a number: finite, and from `least` to `most`.
  void range(const char* name, double value, const char* unit, double least, double most) {
    if (value >= least && value <= most && std::isfinite(value)) return;
    add(name, value, unit,
        std::isfinite(most) ? "allowed is from " + text_of(least) + " to " + text_of(most) + unit
                            : "it must be a number from " + text_of(least) + unit + " up");
  }
  /// Checks that one distance is less than another.
  void order(const std::string& smaller, double less, const std::string& larger, double more) {
    if (!(less >= more)) return;  // NaN has been told already
    add(smaller, less, " m",
        "it must be less than " + prefix_ + larger + ", " + text_of(more) + " m");
  }
  void add(const std::string& name, double value, const char* unit, const std::string& expected) {
    errors_.push_back(prefix_ + name + " is " + text_of(value) + unit + ": " + expected);
  }
  std::vector<std::string> take() { return std::move(errors_); }

 private:
  std::string prefix_;
  std::vector<std::string> errors_;
};

void check_within_range(const std::string& name, double free_distance, double max_distance,
                        ConfigCheck* check) {
  if (!(free_distance > max_distance)) return;
  check->add(name, free_distance, " m",
             "it must not be more than ~max_distance, " + text_of(max_distance) +
                 " m, because nothing farther away is measured");
}

// [s] From a measurement to a robot that stands.
double time_to_stop(const SeparationConfig& config, double age) {
  return config.reaction_time + age + config.stopping_time;
}

void check_separation(const SeparationConfig& config, double max_distance, ConfigCheck* check) {
  check->range("separation/obstacle_speed", config.obstacle_speed, " m/s", 0.0, kInfinity);
  check->range("separation/robot_speed", config.robot_speed, " m/s", 1e-3, kInfinity);
  check->range("separation/reaction_time", config.reaction_time, " s", 0.0, kInfinity);
  check->range("separation/stopping_time", config.stopping_time, " s", 0.0, kInfinity);
  check->range("separation/intrusion", config.intrusion, " m", 0.0, kInfinity);
  check->range("separation/uncertainty", config.uncertainty, " m", 0.0, kInfinity);
  if (!config.enabled) return;
  const double at_rest =
      config.obstacle_speed * time_to_stop(config, 0.0) + config.intrusion + config.uncertainty;
  if (at_rest < max_distance) return;
  check->add(
      "separation", at_rest, " m for a robot that stands",
      "the scale would always be 0, because ~max_distance is " + text_of(max_distance) + " m");
}

// The scale that distances allow: piecewise linear, from 0 at `stop` to 1 at `free`.
double ramp(const SpeedScaleConfig& config, double stop, double free, double bound) {
  if (!(bound > stop)) return 0.0;  // NaN too
  if (bound >= free) return 1.0;
  const double slow = config.slow_distance;
  if (!(slow > stop && slow < free)) return (bound - stop) / (free - stop);
  if (bound <= slow) return config.slow_scale * (bound - stop) / (slow - stop);
  return config.slow_scale + (1.0 - config.slow_scale) * (bound - slow) / (free - slow);
}

// The largest k up to 1 with linear k + square k^2 <= rest, for factors that are not negative; 0
// for NaN, such as of an obstacle that stands for the endless time until the link does.
double largest_share(double linear, double square, double rest) {
  if (!(rest > 0.0 && linear >= 0.0 && square >= 0.0)) return 0.0;
  const double root = std::sqrt(linear * linear + 4.0 * square * rest);
  return std::min(2.0 * rest / std::max(linear + root, 1e-9), 1.0);
}

// The scale that the separation distance allows; see SpeedScale.
double separation_scale(const SeparationConfig& config, double bound, const SpeedScaleInput& input,
                        double age) {
  const double least =
      std::max(config.obstacle_speed,
               std::isnan(input.obstacle_speed) ? kWalkingSpeed : input.obstacle_speed);
  const double left = bound - config.intrusion - config.uncertainty;
  const double reaction = config.reaction_time + age;
  if (input.reach) {
    const StoppingReach& reach = *input.reach;
    return largest_share(reach.speed * reaction + least * reach.time, reach.distance,
                         left - least * reaction);
  }
  return largest_share(config.robot_speed * (reaction + 0.5 * config.stopping_time), 0.0,
                       left - least * time_to_stop(config, age));
}

// The scale that one link allows.
// @param held  [m] the bound that hysteresis gives, never above the link's own
SpeedScaleAnswer scale_of_link(const SpeedScaleConfig& config, double stop, double free,
                               double held, const SpeedScaleInput& input, double age) {
  SpeedScaleAnswer answer;
  answer.bound = held;
  answer.stop_distance = stop;
  answer.free_distance = free;
  answer.scale = ramp(config, stop, free, held);
  answer.rule = answer.scale <= 0.0 ? SpeedRule::kStop : SpeedRule::kSlow;
  if (answer.scale >= 1.0) answer.rule = SpeedRule::kFree;
  if (!config.separation.enabled) return answer;
  const double allowed = separation_scale(config.separation, held, input, age);
  if (allowed < answer.scale) {
    answer.scale = allowed;
    answer.rule = SpeedRule::kSeparation;
  }
  return answer;
}

}  // namespace

std::vector<std::string> config_errors(const SpeedScaleConfig& config, const std::string& prefix,
                                       double max_distance) {
  ConfigCheck check(prefix);
  check.range("stop_distance", config.stop_distance, " m", 0.0, kInfinity);
  check.range("free_distance", config.free_distance, " m", 0.0, kInfinity);
  check.range("hysteresis", config.hysteresis, " m", 0.0, kInfinity);
  check.range("slow_distance", config.slow_distance, " m", 0.0, kInfinity);
  check.range("slow_scale", config.slow_scale, "", 0.0, 1.0);
  check.order("stop_distance", config.stop_distance, "free_distance", config.free_distance);
  check_within_range("free_distance", config.free_distance, max_distance, &check);
  if (config.slow_distance > 0.0) {
    check.order("stop_distance", config.stop_distance, "slow_distance", config.slow_distance);
    check.order("slow_distance", config.slow_distance, "free_distance", config.free_distance);
  }
  check.range("self_stop_distance", config.self_stop_distance, " m", 0.0, kInfinity);
  check.order("self_stop_distance", config.self_stop_distance, "self_free_distance",
              config.self_free_distance);
  check_within_range("self_free_distance", config.self_free_distance, max_distance, &check);
  for (const LinkSpeedDistances& link : config.links) {
    const std::string folder = "links/" + link.link + "/";
    const bool has_stop = !std::isnan(link.stop_distance),
               has_free = !std::isnan(link.free_distance);
    const double stop = has_stop ? link.stop_distance : config.stop_distance;
    const double free = has_free ? link.free_distance : config.free_distance;
    check.range((folder + "stop_distance").c_str(), stop, " m", 0.0, kInfinity);
    check.order((has_stop ? folder : "") + "stop_distance", stop,
                (has_free ? folder : "") + "free_distance", free);
    check_within_range(folder + "free_distance", free, max_distance, &check);
  }
  check_separation(config.separation, max_distance, &check);
  return check.take();
}

SpeedScaleConfig between_links(const SpeedScaleConfig& config) {
  SpeedScaleConfig result;
  result.stop_distance = config.self_stop_distance;
  result.free_distance = config.self_free_distance;
  result.hysteresis = 0.0;
  return result;
}

SpeedScaleConfig fitted_to(SpeedScaleConfig config, double max_distance) {
  if (config.self_free_distance > max_distance) {
    config.self_stop_distance *= max_distance / config.self_free_distance;
    config.self_free_distance = max_distance;
  }
  if (!(config.free_distance > max_distance)) return config;
  const double ratio = max_distance / config.free_distance;
  config.free_distance = max_distance;
  config.stop_distance *= ratio;
  config.slow_distance *= ratio;
  return config;
}

SpeedScale::SpeedScale(std::vector<std::string> links)
    : links_(std::move(links)), held_(links_.size(), kNaN) {}

void SpeedScale::reset() { std::fill(held_.begin(), held_.end(), kNaN); }

bool SpeedScale::knows_all_links(const SpeedScaleConfig& config) const {
  return std::all_of(config.links.begin(), config.links.end(), [this](const auto& one) {
    return std::find(links_.begin(), links_.end(), one.link) != links_.end();
  });
}

std::vector<std::string> SpeedScale::unknown_links(const SpeedScaleConfig& config) const {
  std::vector<std::string> unknown;
  for (const LinkSpeedDistances& one : config.links) {
    if (std::find(links_.begin(), links_.end(), one.link) == links_.end()) {
      unknown.push_back(one.link);
    }
  }
  return unknown;
}

SpeedScale::Distances SpeedScale::distances(const SpeedScaleConfig& config,
                                            std::size_t link) const {
  Distances result{config.stop_distance, config.free_distance};
  for (const LinkSpeedDistances& one : config.links) {
    if (one.link != links_[link]) continue;
    if (!std::isnan(one.stop_distance)) result.stop = one.stop_distance;
    if (!std::isnan(one.free_distance)) result.free = one.free_distance;
  }
  return result;
}

// Follows the bound downward at once, and upward when it is more than the hysteresis larger. A
// CLEAR link's bound that is free already has no noise, because nothing was measured.
void SpeedScale::hold_bound(std::size_t link, const SpeedScaleInput& input, double free,
                            double hysteresis) {
  double& held = held_[link];
  const double bound = input.lower_bound;
  const bool is_free = input.state == LinkState::kClear && bound >= free;
  if (std::isnan(held) || bound < held || is_free) {
    held = bound;
  } else if (bound - hysteresis > held) {
    held = bound - hysteresis;
  }
}

SpeedScaleAnswer SpeedScale::update(const SpeedScaleConfig& config,
                                    Span<const SpeedScaleInput> links,
                                    const std::vector<bool>& counts, double age) {
  SpeedScaleAnswer answer;
  answer.stop_distance = config.stop_distance;
  answer.free_distance = config.free_distance;
  const bool is_complete = links.size() == links_.size() && counts.size() == links_.size();
  if (!is_complete || !knows_all_links(config)) return answer;
  if (config.separation.enabled && std::isnan(age)) return answer;

  SpeedScaleAnswer least = answer;
  least.scale = kInfinity;
  least.bound = kInfinity;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    if (!counts[i]) continue;
    const SpeedScaleInput& input = links[i];
    if (input.state == LinkState::kUnknown || std::isnan(input.lower_bound)) {
      answer.link = static_cast<std::int32_t>(i);
      return answer;
    }
    const auto [stop, free] = distances(config, i);
    hold_bound(i, input, free, config.hysteresis);
    SpeedScaleAnswer one = scale_of_link(config, stop, free, held_[i], input, std::max(age, 0.0));
    if (one.scale > least.scale || (one.scale == least.scale && one.bound >= least.bound)) continue;
    one.link = static_cast<std::int32_t>(i);
    least = one;
  }
  return least.link < 0 ? answer : least;
}

}  // namespace ist
