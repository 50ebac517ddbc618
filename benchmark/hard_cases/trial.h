#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "hard_cases/check.h"
#include "hard_cases/scene.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"

/// Times of the queries in one scene, and what they know when a deadline stops them.
namespace ist::benchmark {

/// What is measured.
struct Setting {
  std::size_t points = 300000;
  double noise = 0.0;          ///< [m]
  double tolerance = 0.001;    ///< [m]
  std::size_t steps = 200;     ///< of the motion, 1 ms each
  std::size_t cold = 10;       ///< queries with a new ProximityQuery and a new snapshot
  std::size_t images = 10;     ///< new images on a motion
  std::size_t checks = 2;      ///< configurations whose answers are checked by brute force
  double budget = 2.0;         ///< [s] of each kind; then it ends, after one query at least
  std::vector<double> shares;  ///< deadlines, over the time of a query without; empty: none

  double max_distance = QueryConfig().max_distance;  ///< [m]
};

/// How a query comes about.
enum Asked {
  kWarm,      ///< on the motion, after the query of 1 ms before
  kNewImage,  ///< on the motion, the first query after a new image
  kCold,      ///< a new ProximityQuery, a new snapshot
  kAsked
};
constexpr std::array<const char*, kAsked> kAskedNames = {"warm", "new image", "cold"};

/// Measurements at one deadline, over the links of all queries.
struct Stopped {
  std::size_t queries = 0;
  std::size_t stopped = 0;         ///< queries that the deadline stopped
  std::size_t links = 0;           ///< answers
  std::size_t unknown = 0;         ///< of them UNKNOWN
  std::size_t free_links = 0;      ///< of them not in contact, in truth
  std::size_t proven_free = 0;     ///< of these with lower_bound > 0
  std::size_t wrong = 0;           ///< bounds that do not hold
  std::vector<double> width;       ///< [m] by link: distance - lower_bound; inf when UNKNOWN
  std::vector<double> overrun_us;  ///< [us] by query: processor time beyond the deadline
};

/// Measurements of one kind.
struct Times {
  std::vector<double> us;        ///< [us] by query, processor time
  std::vector<Stopped> stopped;  ///< by deadline
};

struct Measured {
  std::array<Times, kAsked> times;
  Checked checked;
};

/// Adds the measurements of one scene with one setting. With deadlines, the queries that they stop
/// go along with the whole ones, each with what it proved itself; their states are compared.
void measure(const HardScene& scene, const std::shared_ptr<const RobotModel>& model,
             const Setting& setting, Measured* measured);

}  // namespace ist::benchmark
