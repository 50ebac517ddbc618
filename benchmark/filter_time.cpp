// How long the velocity filter takes, and whether it allocates, with random rows of an arm among
// obstacles.

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "ist_proximity/control/velocity_filter.h"
#include "support.h"
#include "support/allocations.h"

namespace ist::benchmark {
namespace {

constexpr Eigen::Index kJoints = 7, kRows = 40;
constexpr std::size_t kRuns = 30000, kWarmUp = 3000;

/// @param tightness  the larger, the less they allow
ConstraintRows random_rows(std::mt19937_64* random, double tightness) {
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

std::string filter_time() {
  std::mt19937_64 random(1);
  std::normal_distribution<double> command(0.0, 1.0);
  VelocityFilter filter({std::vector<double>(kJoints, 2.0), {}, {}, {}});
  std::vector<double> times, q(kJoints, 0.0), velocity(kJoints);
  long allocations = 0;
  for (std::size_t run = 0; run < kRuns + kWarmUp; ++run) {
    const ConstraintRows rows = random_rows(&random, std::array{0.3, 1.0, 5.0}[run % 3]);
    for (double& v : velocity) v = command(random);
    const long before = test::allocations;
    ThreadTimer timer;
    filter.run(velocity, q, rows);
    const double time = timer.lap();
    if (run < kWarmUp) continue;
    allocations += test::allocations - before;
    times.push_back(time);
  }
  return text_of(
      "%.0f / %.0f / %.0f µs (median, p99, largest) with 7 joints and 40 rows, %ld allocations.\n",
      quantile(times, 0.5), quantile(times, 0.99), quantile(times, 1.0), allocations);
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  ist::benchmark::CommandLine line("How long the velocity filter takes.");
  line.read(argc, argv);
  return line.publish("filter time", ist::benchmark::filter_time());
}
