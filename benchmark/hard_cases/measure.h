#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "hard_cases/check.h"
#include "hard_cases/scene.h"
#include "ist_proximity/robot/robot_model.h"

/// Times of the queries in one scene.
namespace ist::benchmark {

/// What is measured.
struct Setting {
  std::size_t points = 0;
  double noise = 0.0;        ///< [m]
  double tolerance = 0.001;  ///< [m]
  std::size_t steps = 200;   ///< of the motion, 1 ms each
  std::size_t cold = 10;     ///< queries with a new ProximityQuery and a new snapshot
  std::size_t images = 10;   ///< new images on a motion, and before a robot that stands still
  std::size_t checks = 2;    ///< configurations whose answers are checked by brute force
  double budget = 2.0;       ///< [s] of each kind; then it ends, after one query at least
};

/// How a query comes about.
enum class Asked {
  kWarm,           ///< on the motion, after the query of 1 ms before
  kAgain,          ///< the very same pose and snapshot again
  kNewImage,       ///< on the motion, the first query after a new image
  kStillNewImage,  ///< the same pose, the first query after a new image
  kCold            ///< a new ProximityQuery, a new snapshot
};
inline constexpr Asked kAllAsked[] = {Asked::kWarm, Asked::kAgain, Asked::kNewImage,
                                      Asked::kStillNewImage, Asked::kCold};
const char* name_of(Asked asked);

/// Measurements of one kind.
struct Times {
  Asked asked = Asked::kWarm;
  std::vector<double> us;           ///< [us] by query, processor time
  std::vector<double> evaluations;  ///< by query: exact evaluations
  std::vector<double> nearest;      ///< [m] by query: distance of the nearest link
};

/// Measurements of one scene with one setting.
struct Measured {
  std::vector<Times> times;  ///< in the order of kAllAsked
  Checked checked;
};

/// The robot with its packing (default configuration), from the cache where it is there.
std::shared_ptr<const RobotModel> packed(const RobotDescription& robot,
                                         const std::string& cache_directory, double max_error);

Measured measure(const HardScene& scene, const std::shared_ptr<const RobotModel>& model,
                 const Setting& setting);

}  // namespace ist::benchmark
