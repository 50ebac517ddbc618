#include "ros/status/status.h"

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <ist_proximity/ProximityArray.h>

#include <algorithm>

#include "ros/common/text.h"

namespace ist {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using ist_proximity::ProximityArray;

constexpr std::size_t kMaxSentences = 6;  // a status_text is meant to be read

std::uint8_t level_of(std::uint8_t code) {
  if (code == ProximityArray::STALE_CLOUD) return DiagnosticStatus::STALE;
  const bool is_error = code == ProximityArray::NO_CLOUD || code == ProximityArray::NO_POSE ||
                        code == ProximityArray::MODEL_ERROR;
  return is_error ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN;
}

/// Which sources there are, and which of them can be used.
struct Vouchers {
  explicit Vouchers(const StatusInput& input) {
    for (const SourceReport& source : input.sources) {
      measures |= source.measures;
      has_measured |= source.measures && source.has_been_there;
    }
    for (const SourceReport& source : input.sources) {
      any_ok |= source.status.ok() && can_vouch(source);
      all_required_ok &= source.status.ok() || !source.required;
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

/// How a source that is not OK decides over the whole. Where all that is required is there, at
/// least one source that can vouch is needed all the same.
Rank rank_of(const SourceReport& source, const Vouchers& vouchers, bool has_model, double now) {
  const bool needs_one = vouchers.all_required_ok && !vouchers.any_ok;
  if (!source.required && !(needs_one && vouchers.can_vouch(source))) return Rank::kRemark;
  if (source.messages == 0 && !source.is_file) return Rank::kSilent;
  if (!source.is_file && now - source.newest > source.timeout) return Rank::kStale;
  return has_model ? Rank::kUnusable : Rank::kRemark;  // no cloud can be used without a model
}

/// [s] A known world's message that is read for longer is told.
constexpr double kLongReading = 0.5;

/// The doubt about a source whose obstacles count all the same; empty: none.
std::string doubt_of(const SourceReport& source) {
  if (source.measures || source.working <= kLongReading) return source.doubt_of_place;
  return format_text("a message has been read for %.1f s so far: what it states does not count yet",
                     source.working);
}

void note_sources(const StatusInput& input, double now, Findings* findings) {
  const Vouchers vouchers(input);
  for (const SourceReport& source : input.sources) {
    const Status& status = source.status;
    const std::string doubt = doubt_of(source);
    if (status.ok() && doubt.empty()) continue;
    const std::string what = "input " + source.name;
    if (!doubt.empty()) {
      note(Rank::kDegraded, what, "source '" + source.name + "': " + doubt, findings);
    }
    if (status.ok()) continue;
    const Rank rank = rank_of(source, vouchers, input.has_model, now);
    note(rank, what, status.text, findings);
    Finding& own = findings->back();
    if (rank == Rank::kUnusable) own.code = status.code;
    own.level = source.required ? level_of(status.code) : std::uint8_t{DiagnosticStatus::WARN};
  }
}

std::string links(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " link" : " links");
}

void note_deadline(const DeadlineCost& cost, Findings* findings) {
  if (!cost.any()) return;
  const auto say = [findings](const std::string& text) {
    note(Rank::kDegraded, "query", "~query/deadline passed before " + text, findings);
  };
  if (cost.unfinished > 0) {
    const std::string width =
        cost.widest > 0.0 ? format_text("bounds hold but are up to %.1f mm wide", 1e3 * cost.widest)
                          : "nothing is known of them";
    say(links(cost.unfinished) + " met ~query/tolerance: " + width + "; raise either");
  }
  if (cost.unblended > 0) {
    say("the repulsion of " + links(cost.unblended) +
        " was blended: the last one turns with its link for 0.2 s, then it is NaN");
  }
  if (cost.no_penetration > 0) {
    say("the contact volume of " + links(cost.no_penetration) +
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

void note(Rank rank, const std::string& what, const std::string& text, Findings* findings) {
  static constexpr std::uint8_t kCodes[] = {
      ProximityArray::MODEL_ERROR, ProximityArray::LOADING, ProximityArray::NO_CLOUD,
      ProximityArray::STALE_CLOUD, ProximityArray::NO_POSE, ProximityArray::NO_CLOUD,
      ProximityArray::DEGRADED,    ProximityArray::OK};
  const std::uint8_t code = kCodes[static_cast<std::size_t>(rank)];
  if (!text.empty()) findings->push_back({rank, code, level_of(code), what, text});
}

void note(Rank rank, const std::string& what, const std::vector<std::string>& texts,
          Findings* findings) {
  for (const std::string& text : texts) note(rank, what, text, findings);
}

Findings find_all(const StatusInput& input, double now) {
  Findings findings;
  note_deadline(input.deadline, &findings);
  findings.insert(findings.end(), input.findings.begin(), input.findings.end());
  note_sources(input, now, &findings);
  std::stable_sort(findings.begin(), findings.end(),
                   [](const Finding& a, const Finding& b) { return a.rank < b.rank; });
  return findings;
}

Status decide(const Findings& findings, bool clock_runs) {
  std::vector<std::string> texts;
  std::size_t count = 0;
  for (const Finding& finding : findings) {
    if (finding.rank == Rank::kRemark) break;
    if (++count <= kMaxSentences) texts.push_back(finding.text);
  }
  if (count == 0) return {ProximityArray::OK, ""};
  std::string text = join(texts, "; ");
  if (count > kMaxSentences) text += "; and " + std::to_string(count - kMaxSentences) + " more";
  if (!clock_runs) text = "/use_sim_time is set and nothing has come on /clock; " + text;
  return {findings.front().code, text};
}

}  // namespace ist
