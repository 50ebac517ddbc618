#include "ros/output/speed_scale_publisher.h"

#include <std_msgs/Float64.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/geometry/numbers.h"
#include "ros/common/publish.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/output/message_conversion.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;
using ist_proximity::SpeedScaleState;
using LinkMessage = ist_proximity::LinkProximity;

constexpr char kUnknownReach[] =
    "stop: how far a link goes until it stands is not known: the URDF has to limit the velocity of "
    "each joint above it, and ~joint_deceleration to state how that brakes";

std::string metres(double value) { return format_text("%.3f m", value); }

/// Whether the links of a message are those that were announced.
bool are_links_of(const ProximityArray& result, const CountedLinks& links) {
  return result.links.size() == links.links.size() &&
         std::equal(result.links.begin(), result.links.end(), links.links.begin(),
                    [](const auto& link, const std::string& name) { return link.link == name; });
}

std::vector<SpeedScaleInput> inputs_of(const ProximityArray& result,
                                       Span<const StoppingReach> reach) {
  std::vector<SpeedScaleInput> inputs;
  for (const auto& link : result.links) {
    inputs.push_back(
        {static_cast<LinkState>(link.state), link.lower_bound, link.closing_speed_obstacles});
    if (!reach.empty()) inputs.back().reach = reach[inputs.size() - 1];
  }
  return inputs;
}

std::string unknown_text(const SpeedScaleAnswer& answer, const ProximityArray& result) {
  std::string what = "nothing is known of the robot's links";
  if (answer.link >= 0) {
    what = "'" + result.links[static_cast<std::size_t>(answer.link)].link + "' is UNKNOWN";
  }
  return "stop: " + what + (result.status_text.empty() ? "" : ": " + result.status_text);
}

/// The sentence about a scale.
/// @param result  the message that holds the link that decides
std::string speed_scale_text(const SpeedScaleAnswer& answer, const ProximityArray& result) {
  if (answer.rule == SpeedRule::kUnknown) return unknown_text(answer, result);
  const auto& link = result.links[static_cast<std::size_t>(answer.link)];
  const std::string near = "'" + link.link + "' is " + metres(link.lower_bound) + " or more from " +
                           (link.source.empty() ? "obstacles" : "'" + link.source + "'");
  const std::string held =
      answer.bound < link.lower_bound ? " (hysteresis holds " + metres(answer.bound) + ")" : "";
  switch (answer.rule) {
    case SpeedRule::kStop:
      return "stop: " + near + held + ", it stops at " + metres(answer.stop_distance);
    case SpeedRule::kSlow:
      return "slow: " + near + held + ", it is free at " + metres(answer.free_distance);
    case SpeedRule::kSeparation:
      return "separation: " + near + held + ", and obstacles may be there before it stands" +
             (link.state == LinkMessage::CLEAR ? "; to go faster, raise ~max_distance" : "");
    default:
      return "free: " + near;
  }
}

}  // namespace

SpeedScalePublisher::SpeedScalePublisher(ros::NodeHandle private_nh, const ServerConfig& config)
    : is_enabled_(config.speed_scale_enabled),
      self_counts_(config.self_collision.enabled && config.self_collision.in_minimum),
      pose_timeout_(config.pose_timeout),
      scale_({}),
      min_distance_(std::numeric_limits<double>::quiet_NaN()) {
  for (const SourceConfig& source : config.sources) {
    if (!source.file.empty() || std::isinf(source.timeout)) never_stale_.insert(source.name);
  }
  min_publisher_ = private_nh.advertise<std_msgs::Float64>("min_distance", 10);
  if (!is_enabled_) return;
  scale_publisher_ = private_nh.advertise<std_msgs::Float64>("speed_scale", 10);
  state_publisher_ = private_nh.advertise<SpeedScaleState>("speed_scale_state", 10);
}

void SpeedScalePublisher::set_links(const CountedLinks& links, const CountedLinks& self) {
  if (links.links != links_.links) scale_ = SpeedScale(links.links);
  links_ = links;
  self_links_ = self;
}

bool SpeedScalePublisher::is_usable(const ProximityArray& result) const {
  return are_links_of(result, links_) && !is_incomplete(result);
}

bool SpeedScalePublisher::is_fresh(const ProximityArray* self, const ros::Time& now) const {
  return self && are_links_of(*self, self_links_) &&
         seconds_between(self->header.stamp, now) <= pose_timeout_;
}

void SpeedScalePublisher::publish(const ProximityArray& result, const ProximityArray* self,
                                  const SpeedScaleConfig& config, const ros::Time& now,
                                  Span<const StoppingReach> reach) {
  self_problem_.clear();
  if (self_counts_ && !is_fresh(self, now)) {
    self_problem_ = self ? "the newest ~self_proximity is too old, or of another model"
                         : "no ~self_proximity of this model has come yet";
  }
  const bool is_known = is_usable(result) && self_problem_.empty();
  min_distance_ = std::numeric_limits<double>::quiet_NaN();
  if (is_known) min_distance_ = ist::min_distance(result, links_.counts);
  if (is_known && self_counts_) {
    const double own = ist::min_distance(*self, self_links_.counts);
    min_distance_ = std::isnan(own) ? own : std::min(min_distance_, own);  // keeps NaN
  }
  if (is_enabled_) {
    find_scale(result, is_known && self_counts_ ? self : nullptr, config, now, reach);
    publish_number(answer_.scale, scale_publisher_);
    if (state_publisher_.getNumSubscribers() > 0) {
      SpeedScaleState state;
      fill_state(result, config, &state);
      publish_message(state_publisher_, state);
    }
  }
  publish_number(min_distance_, min_publisher_);
  decisive_ = nullptr;
}

/// @param self  null: it does not count
void SpeedScalePublisher::find_scale(const ProximityArray& result, const ProximityArray* self,
                                     const SpeedScaleConfig& config, const ros::Time& now,
                                     Span<const StoppingReach> reach) {
  answer_ = SpeedScaleAnswer();
  decisive_ = &result;
  if (!is_usable(result) || !self_problem_.empty()) return;
  answer_ = scale_.update(config, inputs_of(result, reach), links_.counts, oldest_age(result, now));
  const auto decisive = static_cast<std::size_t>(answer_.link);
  is_reach_known_ = answer_.link < 0 || reach.empty() || reach[decisive].distance < kInfinity;
  if (!self || answer_.rule == SpeedRule::kUnknown) return;
  SpeedScale own_scale(self_links_.links);  // without hysteresis it remembers nothing
  const SpeedScaleAnswer own =
      own_scale.update(between_links(config), inputs_of(*self, {}), self_links_.counts, 0.0);
  if (own.rule != SpeedRule::kUnknown && own.scale >= answer_.scale) return;
  answer_ = own;
  decisive_ = self;
}

/// [s] The age of the oldest measurement in use; maps that never go stale stand still.
double SpeedScalePublisher::oldest_age(const ProximityArray& result, const ros::Time& now) const {
  double oldest = 0.0;
  for (const auto& source : result.sources) {
    const bool is_in_use = source.status == ProximityArray::OK && !std::isnan(source.age);
    if (is_in_use && never_stale_.count(source.name) == 0) oldest = std::max(oldest, source.age);
  }
  return oldest + std::max(seconds_between(result.header.stamp, now), 0.0);
}

void SpeedScalePublisher::fill_state(const ProximityArray& result, const SpeedScaleConfig& config,
                                     SpeedScaleState* state) const {
  state->header = result.header;
  state->scale = answer_.scale;
  state->bound = answer_.bound;
  state->rule = static_cast<std::uint8_t>(answer_.rule);
  state->stop_distance = answer_.stop_distance;
  state->free_distance = answer_.free_distance;
  state->text = speed_scale_text(answer_, *decisive_);
  if (answer_.rule == SpeedRule::kSeparation && !is_reach_known_) state->text = kUnknownReach;
  if (!self_problem_.empty()) state->text = "stop: " + self_problem_;
  const std::vector<std::string> unknown = scale_.unknown_links(config);
  if (!unknown.empty() && !links_.links.empty()) {
    state->text =
        "stop: ~speed_scale/links names " + join(unknown, ", ") + ", which is no monitored link";
  }
  if (answer_.link < 0) return;
  const auto& link = decisive_->links[static_cast<std::size_t>(answer_.link)];
  state->link = link.link;
  state->source = link.source;
}

std::string SpeedScalePublisher::summary() const {
  if (!is_enabled_) return "";
  constexpr const char* kRules[] = {"not known", "stop", "slow", "free", "separation"};
  std::string text = format_text("%.2f, ", answer_.scale);
  text += kRules[static_cast<std::size_t>(answer_.rule)];
  // The monitored links come first there, so that it names a link of either answer.
  if (answer_.link >= 0) text += ", " + self_links_.links[static_cast<std::size_t>(answer_.link)];
  return text;
}

}  // namespace ist
