// Overruns of a query's deadline, as a Markdown table: random deadlines among real depth images.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data. Usage: deadline [count]

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support.h"
#include "truth_scenes.h"

namespace {

using ist::benchmark::Clock;
using ist::benchmark::microseconds_since;
using ist::benchmark::quantile;

struct Tally {
  std::vector<double> full_us, overrun_us;
  int stopped = 0, violations = 0;
};

// Measures one configuration: a complete query first, which gives the truth, then stopped ones.
void measure(ist::ProximityQuery* query, ist::QueryConfig config, const ist::test::TruthCase& truth,
             const ist::CloudSnapshot& cloud, int deadlines, std::mt19937_64* rng, Tally* tally) {
  const std::vector<bool> known(ist::test::kPandaLinks, true);
  std::vector<ist::LinkProximity> whole, results;
  config.deadline = 0.0;
  query->set_config(config);
  Clock::time_point start = Clock::now();
  query->run(truth.X_FL, known, {&cloud}, &whole);
  const double full = microseconds_since(start);
  tally->full_us.push_back(full);
  std::uniform_real_distribution<double> exponent(0.0, std::log10(full));
  for (int i = 0; i < deadlines; ++i) {
    const double deadline_us = std::pow(10.0, exponent(*rng));
    config.deadline = 1e-6 * deadline_us;
    query->set_config(config);
    start = Clock::now();
    const bool complete = query->run(truth.X_FL, known, {&cloud}, &results);
    const double us = microseconds_since(start);
    for (std::size_t k = 0; k < results.size(); ++k) {
      if (results[k].state == ist::LinkState::kUnknown) continue;
      const bool holds = results[k].lower_bound <= whole[k].distance + 1e-9 &&
                         results[k].distance >= whole[k].distance - 1e-9;
      tally->violations += holds ? 0 : 1;
    }
    if (complete) continue;
    ++tally->stopped;
    tally->overrun_us.push_back(std::max(0.0, us - deadline_us));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  const int count = argc > 1 ? std::atoi(argv[1]) : 10000;
  constexpr int kCases = 6 * static_cast<int>(ist::test::kTruthPoses);
  const int per_case = (count + kCases - 1) / kCases;
  const auto model = ist::test::panda_model(data, 0.005);
  const auto scenes = ist::benchmark::truth_scenes(data);
  std::printf(
      "| tolerance | deadlines | stopped | violations | full query median | overrun median | "
      "p99 | p99 / full median |\n|---|---|---|---|---|---|---|---|\n");
  for (const double tolerance : {0.001, 0.0}) {
    std::mt19937_64 rng(1);
    Tally tally;
    int deadlines = 0;
    for (const auto& scene : scenes) {
      ist::QueryConfig config;
      config.max_distance = 10.0;
      config.tolerance = tolerance;
      ist::ProximityQuery query(model, config);
      for (const ist::test::TruthCase& truth : scene.cases) {
        measure(&query, config, truth, *scene.cloud, per_case, &rng, &tally);
        deadlines += per_case;
      }
    }
    const double full = quantile(tally.full_us, 0.5), p99 = quantile(tally.overrun_us, 0.99);
    std::printf("| %.0f mm | %d | %d | %d | %.0f us | %.1f us | %.1f us | %.3f |\n",
                1e3 * tolerance, deadlines, tally.stopped, tally.violations, full,
                quantile(tally.overrun_us, 0.5), p99, p99 / full);
  }
  return 0;
}
