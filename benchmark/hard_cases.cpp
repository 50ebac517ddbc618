// Queries in scenes where branch and bound has little to prune: ties, near-ties, contact,
// enclosure. For each scene, cloud and tolerance: times on a motion at 1 kHz, of the same pose
// asked again, of the first query after an image, and cold; exact evaluations; answers against
// brute force.
//
// Prints a table of medians as it goes, and writes everything as CSV. With --deadline: what stopped
// queries know, and how late they are.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "hard_cases/deadline.h"
#include "hard_cases/measure.h"
#include "near_touch/motions.h"
#include "support.h"
#include "support/data_dir.h"

namespace {

using ist::benchmark::Asked;
using ist::benchmark::HardScene;
using ist::benchmark::Measured;
using ist::benchmark::quantile;
using ist::benchmark::Setting;
using ist::benchmark::Stopped;
using ist::benchmark::Times;

struct Options {
  std::vector<std::string> scenes, links;
  std::vector<double> noise_mm{0.0, 0.3, 1.0, 3.0}, tolerance_mm{1.0, 0.0};
  std::vector<std::size_t> points{10000, 100000, 300000};
  std::vector<double> deadlines;  // shares of the full query's time; empty: no deadline
  double max_error_mm = 1e3 * ist::PackingConfig().max_error;
  Setting setting;
  std::string csv, cache;
  bool list = false;
};

std::vector<HardScene> all_scenes(const std::string& cache) {
  std::vector<HardScene> scenes = ist::benchmark::body_scenes();
  for (HardScene& scene : ist::benchmark::arm_scenes()) scenes.push_back(std::move(scene));
  const auto data = ist::test::data_dir();
  if (!data) {
    std::fprintf(stderr, "%s\n", ist::test::kNoData.c_str());
    return scenes;
  }
  for (HardScene& scene : ist::benchmark::recorded_scenes(*data, cache)) {
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

// Whether the name contains one of the words, or there are none.
bool is_wanted(const std::string& name, const std::vector<std::string>& words) {
  return words.empty() || std::any_of(words.begin(), words.end(), [&](const std::string& word) {
           return name.find(word) != std::string::npos;
         });
}

void print(std::FILE* csv, const HardScene& scene, const Setting& setting, double max_error_mm,
           const Measured& measured) {
  for (const Times& times : measured.times) {
    if (times.us.empty()) continue;
    std::fprintf(
        csv, "\"%s\",\"%s\",%zu,%g,%g,%g,\"%s\",%zu,%.2f,%.2f,%.2f,%.0f,%.4f,%zu,%zu,%.5f\n",
        scene.name.c_str(), scene.link.c_str(), setting.points, 1e3 * setting.noise,
        1e3 * setting.tolerance, max_error_mm, name_of(times.asked), times.us.size(),
        quantile(times.us, 0.5), quantile(times.us, 0.99), quantile(times.us, 1.0),
        quantile(times.evaluations, 0.5), 1e3 * quantile(times.nearest, 0.5),
        measured.checked.answers, measured.checked.wrong, 1e3 * measured.checked.largest_width);
  }
  std::fflush(csv);
}

void print_line(const HardScene& scene, const Setting& setting, const Measured& measured) {
  std::printf("| %s | %s | %zu | %g | %g |", scene.name.c_str(), scene.link.c_str(), setting.points,
              1e3 * setting.noise, 1e3 * setting.tolerance);
  for (const Times& times : measured.times) {
    std::printf(" %.0f / %.0f |", quantile(times.us, 0.5), quantile(times.us, 1.0));
  }
  std::printf(" %.0f | %zu of %zu |\n", quantile(measured.times[0].evaluations, 0.5),
              measured.checked.wrong, measured.checked.answers);
  std::fflush(stdout);
}

void print_header(std::FILE* csv) {
  std::printf("| scene | link | points | noise [mm] | tolerance [mm] |");
  for (const Asked asked : ist::benchmark::kAllAsked) {
    std::printf(" %s, median / largest [µs] |", name_of(asked));
  }
  std::printf(" evaluations, warm | wrong |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  if (csv == nullptr) return;
  std::fprintf(csv,
               "scene,link,points,noise_mm,tolerance_mm,max_error_mm,asked,queries,median_us,"
               "p99_us,max_us,evaluations,nearest_mm,checked,wrong,largest_width_mm\n");
}

void print_deadline_header(std::FILE* csv) {
  std::printf(
      "| scene | link | points | noise [mm] | tolerance [mm] | asked | deadline | full [µs] | "
      "free links with a bound above 0 | UNKNOWN | width median / p90 [mm] | "
      "overrun p99.9 / largest [µs] | wrong |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  if (csv == nullptr) return;
  std::fprintf(csv,
               "scene,link,points,noise_mm,tolerance_mm,max_error_mm,asked,share,queries,"
               "stopped,full_us,links,unknown,free_links,proven_free,width_mm,width_p90_mm,"
               "width_p99_mm,overrun_us,overrun_p99_us,overrun_p999_us,overrun_max_us,wrong\n");
}

void print(std::FILE* csv, const HardScene& scene, const Setting& setting, double max_error_mm,
           const Stopped& s) {
  const char* asked = name_of(s.asked);
  const double width = 1e3 * quantile(s.width, 0.5), width_p90 = 1e3 * quantile(s.width, 0.9);
  const double late = quantile(s.overrun_us, 0.999), latest = quantile(s.overrun_us, 1.0);
  std::string free = "all in contact";
  if (s.free_links > 0) {
    const std::size_t percent = 100 * s.proven_free / s.free_links;
    free = std::to_string(percent) + " % of " + std::to_string(s.free_links);
  }
  std::printf(
      "| %s | %s | %zu | %g | %g | %s | %g %% | %.0f | %s | %zu of %zu | %.2f / %.2f | "
      "%.1f / %.1f | %zu |\n",
      scene.name.c_str(), scene.link.c_str(), setting.points, 1e3 * setting.noise,
      1e3 * setting.tolerance, asked, 1e2 * s.share, quantile(s.full_us, 0.5), free.c_str(),
      s.unknown, s.links, width, width_p90, late, latest, s.wrong);
  std::fflush(stdout);
  if (csv == nullptr) return;
  std::fprintf(csv,
               "\"%s\",\"%s\",%zu,%g,%g,%g,\"%s\",%g,%zu,%zu,%.2f,%zu,%zu,%zu,%zu,%.5f,%.5f,"
               "%.5f,%.2f,%.2f,%.2f,%.2f,%zu\n",
               scene.name.c_str(), scene.link.c_str(), setting.points, 1e3 * setting.noise,
               1e3 * setting.tolerance, max_error_mm, asked, s.share, s.queries, s.stopped,
               quantile(s.full_us, 0.5), s.links, s.unknown, s.free_links, s.proven_free, width,
               width_p90, 1e3 * quantile(s.width, 0.99), quantile(s.overrun_us, 0.5),
               quantile(s.overrun_us, 0.99), late, latest, s.wrong);
  std::fflush(csv);
}

// Measures one scene with one setting. Returns whether every answer was right.
bool run(const HardScene& scene, const std::shared_ptr<const ist::RobotModel>& model,
         const Setting& setting, const Options& options, std::FILE* csv) {
  bool all_right = true;
  if (options.deadlines.empty()) {
    const Measured measured = measure(scene, model, setting);
    print_line(scene, setting, measured);
    if (csv != nullptr) print(csv, scene, setting, options.max_error_mm, measured);
    return measured.checked.wrong == 0;
  }
  for (const Stopped& stopped : measure_deadlines(scene, model, setting, options.deadlines)) {
    print(csv, scene, setting, options.max_error_mm, stopped);
    all_right = all_right && stopped.wrong == 0;
  }
  return all_right;
}

// The settings of a scene.
std::vector<Setting> settings(const HardScene& scene, const Options& options) {
  std::vector<Setting> all;
  for (const std::size_t points : options.points) {
    for (const double noise_mm : options.noise_mm) {
      for (const double tolerance_mm : options.tolerance_mm) {
        Setting setting = options.setting;
        setting.tolerance = 1e-3 * tolerance_mm;
        if (!scene.is_recorded) {
          setting.points = points;
          setting.noise = 1e-3 * noise_mm;
        } else if (points != options.points.front() || noise_mm != options.noise_mm.front()) {
          continue;
        }
        all.push_back(setting);
      }
    }
  }
  return all;
}

// Returns whether every answer was right.
bool run(const Options& options, std::FILE* csv) {
  bool all_right = true;
  (options.deadlines.empty() ? print_header : print_deadline_header)(csv);
  for (const HardScene& scene : all_scenes(options.cache)) {
    if (!is_wanted(scene.name, options.scenes) || !is_wanted(scene.link, options.links)) continue;
    const auto model =
        ist::benchmark::packed(scene.robot, options.cache, 1e-3 * options.max_error_mm);
    for (const Setting& setting : settings(scene, options)) {
      all_right = run(scene, model, setting, options, csv) && all_right;
    }
  }
  return all_right;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Queries in hard scenes: ties, near-ties, contact, enclosure.");
  app.option_defaults()->always_capture_default();
  app.add_option("--scene", options.scenes, "Scenes whose names contain one of these words")
      ->delimiter(',');
  app.add_option("--link", options.links, "The same for links: sphere, box, cylinder, mesh, arm")
      ->delimiter(',');
  app.add_option("--points", options.points, "Points of the clouds")->delimiter(',');
  app.add_option("--noise", options.noise_mm, "Standard deviation of the points [mm]")
      ->delimiter(',');
  app.add_option("--tolerance", options.tolerance_mm, "Of the queries [mm]")->delimiter(',');
  app.add_option("--max-error", options.max_error_mm, "Of the packing [mm]");
  app.add_option("--steps", options.setting.steps, "Queries on the motion, 1 ms apart")
      ->check(CLI::PositiveNumber);
  app.add_option("--cold", options.setting.cold, "Cold queries")->check(CLI::PositiveNumber);
  app.add_option("--images", options.setting.images, "First queries after an image");
  app.add_option("--check", options.setting.checks, "Configurations checked by brute force");
  app.add_option("--budget", options.setting.budget,
                 "Time for the queries of one kind in one scene [s]");
  app.add_option("--deadline", options.deadlines,
                 "Shares of the full query's time after which queries are stopped, e.g. 0.1,0.5")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  app.add_option("--csv", options.csv, "File for all numbers");
  app.add_option("--cache", options.cache, "Folder that keeps packings");
  app.add_flag("--list", options.list, "List the scenes and end");
  CLI11_PARSE(app, argc, argv);
  if (options.list) {
    for (const HardScene& scene : all_scenes(options.cache)) {
      std::printf("%s: %s\n", scene.name.c_str(), scene.link.c_str());
    }
    return 0;
  }
  std::FILE* csv = nullptr;
  if (!options.csv.empty() && (csv = std::fopen(options.csv.c_str(), "w")) == nullptr) {
    std::perror(options.csv.c_str());
    return 2;
  }
  const bool all_right = run(options, csv);
  if (csv != nullptr) std::fclose(csv);
  return all_right ? 0 : 1;
}
