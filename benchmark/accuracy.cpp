// Errors of published distances against the exact truth, as a Markdown table.
//
// Needs the test data: IST_PROXIMITY_DATA, or ../shared/data.
// Usage: accuracy [--update-doc doc/accuracy.md] [max_error_mm ...]

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "document.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "truth_scenes.h"

namespace {

using Clock = std::chrono::steady_clock;

struct Tally {
  std::vector<double> error, width, free_us, contact_us;  // [m], [m], [us], [us]
  int violations = 0, wrong_state = 0;
};

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  const auto at =
      std::min(values.size() - 1, static_cast<std::size_t>(q * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

void measure(const std::shared_ptr<const ist::RobotModel>& model, const ist::QueryConfig& config,
             const ist::CloudSnapshot& snapshot, const std::vector<ist::test::TruthCase>& cases,
             Tally* tally) {
  const std::vector<bool> known(ist::test::kPandaLinks, true);
  ist::ProximityQuery query(model, config);
  std::vector<ist::LinkProximity> results;
  for (const ist::test::TruthCase& truth : cases) {
    const Clock::time_point start = Clock::now();
    query.run(truth.X_FL, known, {&snapshot}, &results);
    const double us = 1e6 * seconds_since(start);
    bool any_contact = false;
    for (std::size_t i = 0; i < results.size(); ++i) {
      const bool contact = truth.links[i].points_inside > 0;
      any_contact = any_contact || contact;
      tally->wrong_state += contact != (results[i].state == ist::LinkState::kContact) ? 1 : 0;
      if (contact) continue;
      const double exact = truth.links[i].distance;
      tally->error.push_back(results[i].distance - exact);
      tally->width.push_back(results[i].distance - results[i].lower_bound);
      const bool holds =
          results[i].lower_bound <= exact + 1e-6 && exact <= results[i].distance + 1e-6;
      tally->violations += holds ? 0 : 1;
    }
    (any_contact ? tally->contact_us : tally->free_us).push_back(us);
  }
}

std::string readme_row(double max_error, double tolerance, const Tally& tally) {
  const auto below = [&](double q) { return 1e3 * quantile(tally.error, q); };
  std::array<char, 160> text{};
  const int begin = std::snprintf(text.data(), text.size(), "| %.0f mm | %.0f%s | %zu | %d | ",
                                  1e3 * max_error, 1e3 * tolerance, tolerance > 0.0 ? " mm" : "",
                                  tally.error.size(), tally.violations);
  const auto at = static_cast<std::size_t>(begin);
  if (below(1.0) < 1e-4) {
    std::snprintf(&text[at], text.size() - at, "below 0.0001 mm | below %.3f mm |\n",
                  std::ceil(1e6 * mean(tally.width)) * 1e-3);
  } else {
    std::snprintf(&text[at], text.size() - at, "%.3f / %.3f / %.3f mm | %.2f mm |\n",
                  1e3 * mean(tally.error), below(0.99), below(1.0), 1e3 * mean(tally.width));
  }
  return text.data();
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  std::vector<double> max_errors;
  std::string document;
  std::string table =
      "| `max_error` | tolerance | cases without contact | violations | error mean / p99 / max | "
      "interval, mean |\n| --- | --- | --- | --- | --- | --- |\n";
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--update-doc") == 0 && i + 1 < argc) {
      document = argv[++i];
    } else {
      max_errors.push_back(1e-3 * std::atof(argv[i]));
    }
  }
  if (max_errors.empty()) max_errors = {0.005, 0.002};
  const auto scenes = ist::benchmark::truth_scenes(data);
  std::printf(
      "| max_error | spheres | packing | tolerance | cases | violations | wrong state | "
      "error mean / p99 / max | width mean | query free median / p99 | in contact |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const double max_error : max_errors) {
    const Clock::time_point start = Clock::now();
    const auto model = ist::test::panda_model(data, max_error);
    const double packing = seconds_since(start);
    std::size_t spheres = 0;
    for (const ist::LinkModel& link : model->links) spheres += link.tree.sphere_count();
    for (const double tolerance : {0.001, 0.0}) {
      ist::QueryConfig config;
      config.max_distance = 10.0;
      config.tolerance = tolerance;
      Tally tally;
      for (const auto& scene : scenes) {
        measure(model, config, *scene.cloud, scene.cases, &tally);
      }
      std::printf(
          "| %.0f mm | %zu | %.1f s | %.0f mm | %zu | %d | %d | %.4f / %.4f / %.4f mm | "
          "%.3f mm | %.0f / %.0f us | %.0f / %.0f us |\n",
          1e3 * max_error, spheres, packing, 1e3 * tolerance, tally.error.size(), tally.violations,
          tally.wrong_state, 1e3 * mean(tally.error), 1e3 * quantile(tally.error, 0.99),
          1e3 * quantile(tally.error, 1.0), 1e3 * mean(tally.width), quantile(tally.free_us, 0.5),
          quantile(tally.free_us, 0.99), quantile(tally.contact_us, 0.5),
          quantile(tally.contact_us, 0.99));
      table += readme_row(max_error, tolerance, tally);
    }
  }
  return document.empty() || ist::benchmark::write_table(document, "accuracy", table) ? 0 : 1;
}
