#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/control/velocity_filter.h"
#include "support.h"
#include "support/allocations.h"

namespace ist::benchmark {

/// Rows of an arm among obstacles, at random.
/// @param tightness  the larger, the less they allow
inline ConstraintRows random_rows(std::mt19937_64* random, double tightness) {
  constexpr Eigen::Index kJoints = 7, kRows = 40;
  std::uniform_real_distribution<double> any(-0.8, 0.8), part(0.0, 1.0);
  ConstraintRows rows;
  rows.count = kRows;
  rows.horizon = 0.02;
  rows.is_complete = true;
  rows.origins.resize(rows.count);
  rows.G.setZero(kRows, kJoints);
  rows.sweep.setZero(kRows, kJoints);
  rows.h.setZero(kRows);
  rows.sweep_limit.setZero(kRows);
  for (Eigen::Index i = 0; i < kRows; ++i) {
    for (Eigen::Index k = 0; k < kJoints; ++k) {
      rows.G(i, k) = any(*random);
      rows.sweep(i, k) = std::abs(rows.G(i, k)) + 0.3 * part(*random);
    }
    rows.h[i] = part(*random) / tightness;
    rows.sweep_limit[i] = (1.0 + 4.0 * part(*random)) / tightness;
  }
  return rows;
}

/// Measures the processor time of a VelocityFilter with 7 joints and 40 rows, for a document.
inline std::string filter_time(std::size_t runs) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> command(0.0, 1.0);
  VelocityFilter filter({std::vector<double>(7, 2.0), {}, {}, {}});
  std::vector<double> times, q(7, 0.0), velocity(7);
  long allocations = 0;
  const std::size_t warm_up = runs / 10;
  for (std::size_t run = 0; run < runs + warm_up; ++run) {
    const ConstraintRows rows = random_rows(&random, std::array{0.3, 1.0, 5.0}[run % 3]);
    for (double& v : velocity) v = command(random);
    const long before = test::allocations;
    ThreadTimer timer;
    filter.run(velocity, q, rows);
    const double time = timer.lap();
    if (run < warm_up) continue;
    allocations += test::allocations - before;
    times.push_back(time);
  }
  std::array<char, 256> text{};
  std::snprintf(
      text.data(), text.size(),
      "%.0f / %.0f / %.0f µs (median, p99, largest) with 7 joints and 40 rows, %ld allocations.\n",
      quantile(times, 0.5), quantile(times, 0.99), quantile(times, 1.0), allocations);
  return text.data();
}

}  // namespace ist::benchmark
