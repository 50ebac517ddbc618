#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// Many configurations of a robot at once, over threads: a planner's batch.
///
/// Each thread has a ProximityQuery of its own and takes configurations in order, a few at a time,
/// so that neighbours in the batch start from each other's answers. At tolerance 0 the distances do
/// not depend on the number of threads; else they lie within the tolerance. A deadline counts for
/// each configuration. Queries allocate nothing; a batch starts its threads and lets them end. Not
/// thread safe: one batch at a time.
class ProximityBatch {
 public:
  /// @param threads  the caller's included; 0: as many as there are cores
  ProximityBatch(std::shared_ptr<const RobotModel> model, const QueryConfig& config,
                 int threads = 0);
  ~ProximityBatch();
  ProximityBatch(ProximityBatch&&) noexcept;
  ProximityBatch& operator=(ProximityBatch&&) noexcept;

  /// As ProximityQuery::run for each configuration.
  /// @param X_FL     n configurations one after the other, each link frame -> fixed frame by link
  /// @param known    by link, for all configurations
  /// @param results  n times the number of links, in the order of X_FL, overwritten
  /// @returns false when a deadline passed before every link of a configuration met its tolerance
  bool run(const std::vector<Eigen::Isometry3d>& X_FL, const std::vector<bool>& known,
           SnapshotSpan clouds, std::vector<LinkProximity>* results);

  /// As ProximityQuery::run_minimum for each configuration.
  /// @param results  n, overwritten
  bool run_minimum(const std::vector<Eigen::Isometry3d>& X_FL, const std::vector<bool>& known,
                   SnapshotSpan clouds, std::vector<RobotProximity>* results);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
