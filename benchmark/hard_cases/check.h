#pragma once

#include <cstddef>
#include <random>
#include <vector>

#include "hard_cases/scene.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"

/// Answers against brute force over every triangle.
namespace ist::benchmark {

/// Counts of answers, one for each link and configuration.
struct Checked {
  std::size_t answers = 0;
  std::size_t wrong = 0;
  double largest_width = 0.0;  ///< [m] distance - lower_bound
};

/// Checks the answers to one configuration, which no deadline stopped. `lower_bound` has to hold
/// for points that are likely to be nearest and for random ones. `distance` has to be that of the
/// point named, to a quarter of the tolerance. The width has to be at most the tolerance.
void check_answers(const HardScene& scene, const RobotModel& model, const Frame& frame,
                   const Poses& X_FL, const QueryConfig& config,
                   const std::vector<LinkProximity>& answers, std::mt19937_64* rng,
                   Checked* checked);

}  // namespace ist::benchmark
