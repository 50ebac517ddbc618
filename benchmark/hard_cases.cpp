// Queries in scenes where branch and bound has little to prune: ties, near-ties, contact,
// enclosure. For each scene, cloud and tolerance: times on a motion at 1 kHz, of the same pose
// asked again, of the first query after an image, and cold; exact evaluations; answers against
// brute force.
//
// Prints a table of medians as it goes, and writes everything as CSV.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "hard_cases/measure.h"
#include "support.h"

namespace {

using ist::benchmark::Asked;
using ist::benchmark::HardScene;
using ist::benchmark::Measured;
using ist::benchmark::quantile;
using ist::benchmark::Setting;
using ist::benchmark::Times;

struct Options {
  std::vector<std::string> scenes, links;
  std::vector<double> noise_mm{0.0, 0.3, 1.0, 3.0}, tolerance_mm{1.0, 0.0};
  std::vector<std::size_t> points{10000, 100000, 300000};
  double max_error_mm = 1e3 * ist::PackingConfig().max_error;
  Setting setting;
  std::string csv, cache;
  bool list = false;
};

std::vector<HardScene> all_scenes() {
  std::vector<HardScene> scenes = ist::benchmark::body_scenes();
  for (HardScene& scene : ist::benchmark::arm_scenes()) scenes.push_back(std::move(scene));
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

// Returns whether every answer was right.
bool run(const Options& options, std::FILE* csv) {
  bool all_right = true;
  print_header(csv);
  for (const HardScene& scene : all_scenes()) {
    if (!is_wanted(scene.name, options.scenes) || !is_wanted(scene.link, options.links)) continue;
    const auto model =
        ist::benchmark::packed(scene.robot, options.cache, 1e-3 * options.max_error_mm);
    Setting setting = options.setting;
    for (const std::size_t points : options.points) {
      for (const double noise_mm : options.noise_mm) {
        for (const double tolerance_mm : options.tolerance_mm) {
          setting.points = points;
          setting.noise = 1e-3 * noise_mm;
          setting.tolerance = 1e-3 * tolerance_mm;
          const Measured measured = measure(scene, model, setting);
          all_right = all_right && measured.checked.wrong == 0;
          print_line(scene, setting, measured);
          if (csv != nullptr) print(csv, scene, setting, options.max_error_mm, measured);
        }
      }
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
  app.add_option("--link", options.links, "The same for links: ball, box, cylinder, mesh, arm")
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
  app.add_option("--csv", options.csv, "File for all numbers");
  app.add_option("--cache", options.cache, "Folder that keeps packings");
  app.add_flag("--list", options.list, "List the scenes and end");
  CLI11_PARSE(app, argc, argv);
  if (options.list) {
    for (const HardScene& scene : all_scenes()) {
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
