#include "ros/status/status.h"

#include <ist_proximity/ProximityArray.h>

#include <algorithm>

#include "ros/common/text.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

constexpr std::size_t kMaxSentences = 6;  // a status_text is meant to be read

/// The sentences that apply, the deciding one first.
class Sentences {
 public:
  void add(std::uint8_t code, const std::string& text) {
    if (texts_.empty()) code_ = code;
    texts_.push_back(text);
  }
  void add(const Status& status) { add(status.code, status.text); }
  void add(std::uint8_t code, const std::vector<std::string>& texts) {
    for (const std::string& text : texts) add(code, text);
  }

  bool empty() const { return texts_.empty(); }

  Status status() const {
    const std::size_t shown = std::min(texts_.size(), kMaxSentences);
    std::string text =
        join({texts_.begin(), texts_.begin() + static_cast<std::ptrdiff_t>(shown)}, "; ");
    if (texts_.size() > shown) {
      text += "; and " + std::to_string(texts_.size() - shown) + " more";
    }
    return {code_, text};
  }

 private:
  std::uint8_t code_ = ProximityArray::OK;
  std::vector<std::string> texts_;
};

/// Which sources there are, and which of them can be used.
struct Vouchers {
  explicit Vouchers(const StatusInput& input) {
    for (const SourceReport& source : input.sources) {
      measures |= source.measures;
      has_measured |= source.measures && source.has_been_there;
    }
    for (std::size_t i = 0; i < input.sources.size(); ++i) {
      const bool is_ok = input.source_statuses[i].ok();
      any_ok |= is_ok && can_vouch(input.sources[i]);
      all_required_ok &= is_ok || !input.sources[i].required;
    }
  }
  /// Whether a source says what is free, while it is OK.
  bool can_vouch(const SourceReport& source) const {
    if (source.measures || source.is_memory) return source.measures;
    return !measures || (source.required && !has_measured);
  }

  bool measures = false;  ///< whether anything does that is configured
  bool has_measured = false;
  bool any_ok = false;  ///< any that can vouch
  bool all_required_ok = true;
};

/// By source: whether its status decides over the whole. Where all that is required is there, at
/// least one source that can vouch is needed all the same.
std::vector<bool> deciding_sources(const StatusInput& input) {
  const Vouchers vouchers(input);
  const bool needs_one = vouchers.all_required_ok && !vouchers.any_ok;
  std::vector<bool> deciding(input.sources.size());
  for (std::size_t i = 0; i < deciding.size(); ++i) {
    const SourceReport& source = input.sources[i];
    deciding[i] = !input.source_statuses[i].ok() &&
                  (source.required || (needs_one && vouchers.can_vouch(source)));
  }
  return deciding;
}

bool arrives_fresh(const SourceReport& source, double now) {
  return source.is_file || (source.messages > 0 && now - source.newest <= source.timeout);
}

/// Adds the sources that send nothing, and those that are stale.
void add_silent_sources(const StatusInput& input, double now, Sentences* sentences) {
  const std::vector<bool> deciding = deciding_sources(input);
  const auto& sources = input.sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (deciding[i] && sources[i].messages == 0 && !sources[i].is_file) {
      sentences->add(ProximityArray::NO_CLOUD, input.source_statuses[i].text);
    }
  }
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (deciding[i] && sources[i].messages > 0 && !arrives_fresh(sources[i], now)) {
      sentences->add(ProximityArray::STALE_CLOUD, input.source_statuses[i].text);
    }
  }
}

/// Adds the sources whose fresh messages cannot be used.
void add_unusable_sources(const StatusInput& input, double now, Sentences* sentences) {
  if (!input.model_problem.empty()) return;  // no cloud can be used without a model
  const std::vector<bool> deciding = deciding_sources(input);
  for (std::size_t i = 0; i < input.sources.size(); ++i) {
    if (deciding[i] && arrives_fresh(input.sources[i], now)) {
      sentences->add(input.source_statuses[i]);
    }
  }
}

std::string links(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " link" : " links");
}

/// Adds what a deadline has cost.
void add_deadline(const DeadlineCost& cost, Sentences* sentences) {
  if (!cost.any()) return;
  const std::string passed = "~query/deadline passed before ";
  if (cost.unfinished > 0) {
    const std::string width =
        cost.widest > 0.0 ? format_text("bounds hold but are up to %.1f mm wide", 1e3 * cost.widest)
                          : "nothing is known of them";
    sentences->add(
        ProximityArray::DEGRADED,
        passed + links(cost.unfinished) + " met ~query/tolerance: " + width + "; raise either");
  }
  if (cost.unblended > 0) {
    sentences->add(ProximityArray::DEGRADED,
                   passed + "the repulsion of " + links(cost.unblended) +
                       " was blended: the last one turns with its link for 0.2 s, then it is NaN");
  }
  if (cost.no_penetration > 0) {
    sentences->add(
        ProximityArray::DEGRADED,
        passed + "the contact volume of " + links(cost.no_penetration) +
            format_text(" was summed (%.0f %% of the obstacles near): ", 100.0 * cost.least_known) +
            "its penetration is NaN");
  }
}

}  // namespace

void DeadlineCost::add(const DeadlineCost& other) {
  unfinished = std::max(unfinished, other.unfinished);
  widest = std::max(widest, other.widest);
  unblended = std::max(unblended, other.unblended);
  no_penetration = std::max(no_penetration, other.no_penetration);
  least_known = std::min(least_known, other.least_known);
}

bool clouds_usable(const StatusInput& input) {
  const Vouchers vouchers(input);
  return vouchers.all_required_ok && vouchers.any_ok;
}

bool StatusInput::is_fine() const {
  return model_problem.empty() && link_errors.empty() && pose_problems.empty() &&
         pose_doubts.empty() && unknown_space_problem.empty() && !deadline.any() &&
         !outside_region &&
         std::all_of(source_statuses.begin(), source_statuses.end(),
                     [](const Status& status) { return status.ok(); }) &&
         std::all_of(sources.begin(), sources.end(),
                     [](const SourceReport& source) { return source.doubt_of_place.empty(); });
}

Status overall_status(const StatusInput& input, double now) {
  if (input.is_fine()) return {ProximityArray::OK, ""};
  Sentences sentences;
  if (!input.model_problem.empty() && !input.is_loading) {
    sentences.add(ProximityArray::MODEL_ERROR, input.model_problem);
  }
  sentences.add(ProximityArray::MODEL_ERROR, input.link_errors);
  if (input.is_loading) sentences.add(ProximityArray::LOADING, input.model_problem);
  add_silent_sources(input, now, &sentences);
  sentences.add(ProximityArray::NO_POSE, input.pose_problems);
  add_unusable_sources(input, now, &sentences);
  add_deadline(input.deadline, &sentences);
  if (input.outside_region) {
    sentences.add(ProximityArray::DEGRADED,
                  "a link is farther out than the limits of prismatic joints allow and is near "
                  "places where points were dropped as outside the region of interest: obstacles "
                  "there are not known; state the true limits in the URDF");
  }
  sentences.add(ProximityArray::DEGRADED, input.pose_doubts);
  for (const SourceReport& source : input.sources) {
    if (source.doubt_of_place.empty()) continue;
    sentences.add(ProximityArray::DEGRADED,
                  "source '" + source.name + "': " + source.doubt_of_place);
  }
  if (!input.unknown_space_problem.empty()) {
    sentences.add(ProximityArray::DEGRADED, input.unknown_space_problem);
  }
  if (sentences.empty()) return {ProximityArray::OK, ""};
  Status status = sentences.status();
  if (!input.clock_runs) {
    status.text = "/use_sim_time is set and nothing has come on /clock; " + status.text;
  }
  return status;
}

}  // namespace ist
