#pragma once

#include <ist_proximity/ProximityArray.h>

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "ros/input/source_report.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/status/status.h"

namespace ist {

/// Computation times of the last thousand cycles. Not thread safe.
class CycleTimes {
 public:
  void add(double seconds);
  /// The q-quantile [s], 0.5 being the median; NaN before the first time.
  double quantile(double q) const;

 private:
  static constexpr std::size_t kKept = 1000;
  std::vector<double> ring_;
  std::size_t total_ = 0;
};

/// The parts of a cycle whose times are told.
enum CyclePart : std::size_t {
  kPartPoses,
  kPartQuery,
  kPartRepulsion,
  kPartPenetration,
  kPartMessage,  ///< with the sources and the status
  kPartPublish,  ///< markers, joint repulsion and roscpp's serialization too
  kCycleParts
};

/// Results of the last cycle, for the diagnostics thread.
struct CycleReport {
  Status status{0, ""};
  Findings findings;  ///< of the last cycle, and what the diagnostics add
  std::vector<SourceReport> sources;
  std::string parameter_problem;                 ///< LiveParameters::problem()
  std::optional<JointStateReport> joint_states;  ///< null with pose_source tf
  std::size_t links_known = 0, links_monitored = 0;
  double pose_age = 0.0;   ///< [s] of the poses' common instant, when any link is known
  std::size_t cycles = 0;  ///< since the start, with or without a model
  CycleTimes times;        ///< of cycles with a model: computation_time
  std::array<CycleTimes, kCycleParts> parts;  ///< by CyclePart
  double deadline = 0.0;                      ///< [s] of the last cycle; 0: none
  std::size_t deadlines_missed = 0;  ///< cycles that the deadline cut short, since the start
  DeadlineCost worst_deadline;       ///< since the last diagnostics
  double min_distance = 0.0;         ///< [m] as on ~min_distance; NaN: not known
  std::string speed_scale;           ///< the scale, the rule and the link; empty: not enabled
  std::string counted_links;         ///< which links do not count in both, and why
  std::string zones;                 ///< as ZoneStore::summary()
  std::size_t query_memory = 0;      ///< [bytes] of the cycle's query
  std::size_t markers_drawn = 0;     ///< messages on ~markers, drawn while it has subscribers

  /// Takes the sources, what is found, and the status.
  void take(const StatusInput& input, const Findings& found, const Status& decided);
  /// Adds the times that a message tells.
  void add_times(const ist_proximity::ProximityArray& message);
};

}  // namespace ist
