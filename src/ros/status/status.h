#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "ros/input/source_report.h"

namespace ist {

// Pure functions that decide the status constants of ProximityArray and their texts.

/// A status constant of ProximityArray, and a sentence unless it is OK.
struct Status {
  std::uint8_t code;
  std::string text;
  bool ok() const { return code == 0; }
};

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

/// Everything that decides the status of a ProximityArray.
struct StatusInput {
  std::string model_problem;             ///< not empty: there is no model, or not all of it (yet)
  bool is_loading = false;               ///< `model_problem` says how far the model is
  std::vector<std::string> link_errors;  ///< sentences on links without usable geometry
  std::vector<SourceReport> sources;
  std::vector<Status> source_statuses;     ///< by source
  std::vector<std::string> pose_problems;  ///< one sentence each
  std::vector<std::string> pose_doubts;    ///< poses that are known, and hardly true
  std::string unknown_space_problem;       ///< why nothing of space is known; empty: it is
  DeadlineCost deadline;
  bool outside_region = false;  ///< a link is farther out than the joint limits allow
  bool clock_runs = true;       ///< false: simulated time, and nothing on /clock yet

  /// Whether nothing is wrong, so that nothing has to be said.
  bool is_fine() const;
};

/// Whether queries may use clouds: every required source is usable, and at least one that can vouch
/// for what is free. A partial view must not be shown as clear. Sources that measure vouch. Known
/// worlds and maps that stay for ever do where nothing that measures is configured, or they are
/// required and what measures is not and has never been there: they are all that was asked for
/// then. A memory never does.
bool clouds_usable(const StatusInput& input);

/// Decides the status of a ProximityArray. The first that applies: a model or link error;
/// a model that is being made; a required source without any message; a stale required source; a
/// missing pose; a required source whose messages cannot be used; a passed deadline and other
/// doubts; OK. The text begins with the deciding sentence and continues with the others.
/// @param now  [s] ROS clock
Status overall_status(const StatusInput& input, double now);

}  // namespace ist
