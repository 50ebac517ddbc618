#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "hard_cases/measure.h"

/// What a query knows when its deadline stops it.
namespace ist::benchmark {

/// Measurements at one deadline, over the links of all queries.
struct Stopped {
  double share = 0.0;  ///< the deadline over the time of the full query
  Asked asked = Asked::kWarm;
  std::size_t queries = 0;
  std::size_t stopped = 0;         ///< queries that the deadline stopped
  std::size_t links = 0;           ///< answers
  std::size_t unknown = 0;         ///< of them UNKNOWN
  std::size_t free_links = 0;      ///< of them not in contact, in truth
  std::size_t proven_free = 0;     ///< of these with lower_bound > 0
  std::size_t wrong = 0;           ///< bounds that do not hold
  std::vector<double> full_us;     ///< [us] by query: the full query
  std::vector<double> width;       ///< [m] by link: distance - lower_bound; inf when UNKNOWN
  std::vector<double> overrun_us;  ///< [us] by query: processor time beyond the deadline
};

/// For each share: queries on the motion, the first ones after a new image, and cold ones, each
/// with the deadline that is this share of the time that a full query takes in the same state.
std::vector<Stopped> measure_deadlines(const HardScene& scene,
                                       const std::shared_ptr<const RobotModel>& model,
                                       const Setting& setting, const std::vector<double>& shares);

}  // namespace ist::benchmark
