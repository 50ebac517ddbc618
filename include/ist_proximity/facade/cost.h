#pragma once

#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/facade/robot.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// The processor time that each configuration of a motion takes on this machine [s], by
/// configuration. One thread answers one after the other, as a control loop does.
struct CycleCost {
  std::vector<double> query;      ///< ProximityQuery::run for all links
  std::vector<double> repulsion;  ///< Repulsion for all links
  std::vector<double> width;      ///< [m] largest distance - lower_bound of a link that is NEAR
  std::vector<double>
      smallest;  ///< [m] smallest lower bound; +inf when CLEAR, -inf where one is unknown
  std::vector<int> unknown;  ///< links that are UNKNOWN
};

/// How the cycles follow each other, and what each of them asks.
struct CycleConfig {
  int per_cloud = 33;  ///< >= 1: cycles for each cloud
  /// [s] >= 0: a cycle begins this long after the last one began, and the thread sleeps between
  /// them, as a controller's does. Caches are cold then, and cycles take longer. 0: no sleep
  double period = 0.0;
  QueryConfig query;          ///< what a cycle asks
  RepulsionConfig repulsion;  ///< what is computed from the answers
};

/// Measures the cycles of a node along a motion.
///
/// Every cloud is copied and indexed anew by another thread, as in the node, so that the first
/// cycles after it pay for what a new cloud costs a query: its points are read when they are first
/// needed, and nothing of the last answer holds for them.
/// @param q          n configurations one after the other
/// @param cloud      the points of each of the clouds, valid during the call; owner is not needed
/// @param obstacles  how they are indexed
/// @throws std::invalid_argument as Robot::distances() and Obstacles, and where config is out of
///         its range
CycleCost measure_cycles(const Robot& robot, Span<const double> q, const RawCloud& cloud,
                         const ObstaclesConfig& obstacles, const CycleConfig& config);

}  // namespace ist
