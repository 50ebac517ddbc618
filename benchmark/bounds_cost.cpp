// Cost of tight bounds, as a Markdown table: queries that need only an upper bound against queries
// to a tolerance, in free space and in contact.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data. Usage: bounds_cost [max_error_mm]

#include <cstdio>
#include <cstdlib>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support.h"
#include "truth_scenes.h"

namespace {

using ist::benchmark::Clock;
using ist::benchmark::microseconds_since;
using ist::benchmark::quantile;

struct Mode {
  const char* name;
  double tolerance;  // [m]
};

// With a tolerance above all distances the first point found suffices, but contact is still
// decided.
constexpr Mode kModes[] = {
    {"upper bound only", 100.0}, {"5 mm", 0.005}, {"1 mm", 0.001}, {"exact", 0.0}};

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  const double max_error = argc > 1 ? 1e-3 * std::atof(argv[1]) : 0.005;
  const auto model = ist::test::panda_model(data, max_error);
  const std::vector<bool> known(ist::test::kPandaLinks, true);
  const auto scenes = ist::benchmark::truth_scenes(data);
  std::printf(
      "| wanted | free median / p99 | in contact median / p99 | exact evaluations free / in "
      "contact |\n|---|---|---|---|\n");
  for (const Mode& mode : kModes) {
    std::vector<double> us[2], evaluations[2];  // free, in contact
    for (const auto& scene : scenes) {
      ist::QueryConfig config;
      config.max_distance = 10.0;
      config.tolerance = mode.tolerance;
      ist::ProximityQuery query(model, config);
      std::vector<ist::LinkProximity> results;
      for (const ist::test::TruthCase& truth : scene.cases) {
        const Clock::time_point start = Clock::now();
        query.run(truth.X_FL, known, {scene.cloud.get()}, &results);
        const double elapsed = microseconds_since(start);
        bool contact = false;
        for (const ist::test::TruthRecord& link : truth.links) {
          contact = contact || link.points_inside > 0;
        }
        us[contact ? 1 : 0].push_back(elapsed);
        evaluations[contact ? 1 : 0].push_back(
            static_cast<double>(query.statistics().exact_evaluations));
      }
    }
    std::printf("| %s | %.0f / %.0f us | %.0f / %.0f us | %.0f / %.0f |\n", mode.name,
                quantile(us[0], 0.5), quantile(us[0], 0.99), quantile(us[1], 0.5),
                quantile(us[1], 0.99), quantile(evaluations[0], 0.5),
                quantile(evaluations[1], 0.5));
  }
  return 0;
}
