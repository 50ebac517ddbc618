#pragma once

#include <vector>

#include "ist_proximity/facade/robot.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// The processor time that each configuration of a motion takes on this machine [s], by
/// configuration. One thread answers one after the other, as a control loop does.
struct CycleCost {
  std::vector<double> query;      ///< ProximityQuery::run for all links
  std::vector<double> repulsion;  ///< Repulsion for all links
  std::vector<double> width;      ///< [m] largest distance - lower_bound of a link that is NEAR
  std::vector<double> smallest;   ///< [m] smallest lower bound of a known link; +inf when CLEAR
  std::vector<int> unknown;       ///< links that are UNKNOWN
};

/// Measures the cycles of a node along a motion, with a new snapshot every `per_cloud` cycles.
/// @param q          n configurations one after the other
/// @param scenes     snapshots that take turns: two of the same scene act as a camera's stream
/// @param per_cloud  >= 1
/// @throws std::invalid_argument as Robot::distances(), and where there is no scene
CycleCost measure_cycles(const Robot& robot, Span<const double> q,
                         const std::vector<Obstacles>& scenes, int per_cloud,
                         const QueryConfig& query, const RepulsionConfig& repulsion);

}  // namespace ist
