#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// Queries for many configurations of a robot at once, on several threads: a planner's batch.
///
/// Each thread has a ProximityQuery of its own and takes chunks of consecutive configurations, so
/// that the answers to one configuration are the warm start of the next. At tolerance 0 the
/// distances do not depend on the number of threads; otherwise they lie within the tolerance. A
/// deadline applies to each configuration by itself. Queries allocate nothing; each run starts its
/// threads and joins them. Not thread safe: one run at a time.
class ProximityBatch {
 public:
  /// @param threads  including the caller's; 0: as many as there are cores
  ProximityBatch(std::shared_ptr<const RobotModel> model, const QueryConfig& config,
                 int threads = 0);
  ~ProximityBatch();
  ProximityBatch(ProximityBatch&&) noexcept;
  ProximityBatch& operator=(ProximityBatch&&) noexcept;

  /// Calls ProximityQuery::run for each configuration.
  /// @param X_FL     n configurations one after the other, each with one pose per link: link frame
  ///                 -> fixed frame
  /// @param known    by link, for all configurations
  /// @param results  one for each of X_FL, overwritten; UNKNOWN for those at the end that are fewer
  ///                 than a configuration
  /// @returns false when a deadline passed before every link of a configuration met its tolerance
  bool run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known, SnapshotSpan clouds,
           std::vector<LinkProximity>* results);

  /// Calls ProximityQuery::run_minimum for each configuration.
  /// @param results  n, overwritten
  bool run_minimum(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                   SnapshotSpan clouds, std::vector<RobotProximity>* results);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
