// The processor time of a VelocityFilter, as Markdown: 7 joints and 40 random rows, loose to tight.
//
// Usage: velocity_filter

#include "ist_proximity/control/velocity_filter.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "support.h"

namespace {

constexpr Eigen::Index kJoints = 7, kRows = 40;

ist::ConstraintRows random_rows(std::mt19937_64* rng, double tightness) {
  std::uniform_real_distribution<double> any(-0.8, 0.8), part(0.0, 1.0);
  ist::ConstraintRows rows;
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
      rows.G(i, k) = any(*rng);
      rows.sweep(i, k) = std::abs(rows.G(i, k)) + 0.3 * part(*rng);
    }
    rows.h[i] = part(*rng) / tightness;
    rows.sweep_limit[i] = (1.0 + 4.0 * part(*rng)) / tightness;
  }
  return rows;
}

}  // namespace

int main() {
  std::mt19937_64 rng(1);
  std::normal_distribution<double> command(0.0, 1.0);
  std::puts(
      "| tightness | held back | p50 [us] | p99 [us] | most [us] | most iterations |\n"
      "| --- | --- | --- | --- | --- | --- |");
  for (const double tightness : {0.3, 1.0, 5.0}) {
    ist::VelocityFilter filter({std::vector<double>(kJoints, 2.0), {}, {}, {}});
    std::vector<double> times, q(kJoints, 0.0), velocity(kJoints);
    ist::benchmark::ThreadTimer timer;
    int held = 0, most = 0;
    constexpr int kRuns = 20000;
    for (int run = 0; run < kRuns; ++run) {
      const ist::ConstraintRows rows = random_rows(&rng, tightness);
      for (double& v : velocity) v = command(rng);
      timer.lap();
      const ist::FilterAnswer& answer = filter.run(velocity, q, rows);
      times.push_back(timer.lap());
      held += answer.status == ist::FilterStatus::kLimited ? 1 : 0;
      most = std::max(most, answer.iterations);
    }
    std::printf("| %.1f | %.1f %% | %.1f | %.1f | %.1f | %d |\n", tightness, 100.0 * held / kRuns,
                ist::benchmark::quantile(times, 0.5), ist::benchmark::quantile(times, 0.99),
                ist::benchmark::quantile(times, 1.0), most);
  }
  return 0;
}
