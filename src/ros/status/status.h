#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "ros/input/source_report.h"

namespace ist {

// Pure functions that decide the status constants of ProximityArray and their texts.

/// Decides NO_CLOUD, STALE_CLOUD or OK for one source; only a source that is OK says what is free.
/// @param now  [s] ROS clock
Status source_status(const SourceReport& source, double now);

/// The same for what a source remembers: it is no fresher than that source.
Status memory_status(const SourceReport& memory, const Status& parent);

/// The cost of a deadline in one cycle, or in the worst of several.
struct DeadlineCost {
  std::size_t unfinished = 0;  ///< links whose bounds are wider than the tolerance, or UNKNOWN
  double widest = 0.0;         ///< [m] of these bounds, where they are known
  std::size_t unblended = 0;   ///< links whose repulsion is the last one that was blended, or NaN
  std::size_t no_penetration = 0;  ///< links whose penetration is NaN
  double least_known = 1.0;        ///< share of the obstacles near such a link that was summed

  bool any() const { return unfinished + unblended + no_penetration > 0; }
  /// Keeps the worse of both by each number.
  void add(const DeadlineCost& other);
};

/// The kinds of things that are not as they should be. The first kinds decide over the later ones.
enum class Rank : std::uint8_t {
  kModel,     ///< there is no model, or a link of it cannot be used
  kLoading,   ///< the model is being made
  kSilent,    ///< a required source has sent nothing
  kStale,     ///< a required source is stale
  kPose,      ///< a link's pose is not known
  kUnusable,  ///< a required source's messages cannot be used
  kDegraded,  ///< what is known is known less well
  kRemark     ///< it does not change the status
};

/// One thing that is not as it should be. What the message, the diagnostics and the log say is the
/// list of these.
struct Finding {
  Rank rank;
  std::uint8_t code;   ///< of ProximityArray
  std::uint8_t level;  ///< of diagnostic_msgs/DiagnosticStatus
  std::string what;    ///< it concerns: "model", "pose", "query" or "input NAME"
  std::string text;    ///< a sentence with its value, cause and cure
  double since = 0.0;  ///< [s] for which there has been one of this kind; of diagnostics
};
using Findings = std::vector<Finding>;

/// Adds a finding, with the usual code and level of its kind; none where the text is empty.
void note(Rank rank, const std::string& what, const std::string& text, Findings* findings);
void note(Rank rank, const std::string& what, const std::vector<std::string>& texts,
          Findings* findings);

/// Everything that decides the status of a ProximityArray.
struct StatusInput {
  Findings findings;      ///< but for those of the members below
  bool has_model = true;  ///< false: there is no model, or not all of it (yet)
  std::vector<SourceReport> sources;
  DeadlineCost deadline;
  bool clock_runs = true;  ///< false: simulated time, and nothing on /clock yet
};

/// Whether queries may use clouds: every required source is usable, and at least one that can vouch
/// for what is free. A partial view must not be shown as clear. Sources that measure vouch. Known
/// worlds and maps that stay for ever do where nothing that measures is configured, or they are
/// required and what measures is not and has never been there: they are all that was asked for
/// then. A memory never does.
bool clouds_usable(const StatusInput& input);

/// Lists all findings, the deciding one first. The list is empty when nothing has to be said.
/// @param now  [s] ROS clock
Findings find_all(const StatusInput& input, double now);

/// Decides the status of a ProximityArray. The text begins with the deciding sentence and continues
/// with the others.
/// @param findings  of find_all()
Status decide(const Findings& findings, bool clock_runs);

}  // namespace ist
