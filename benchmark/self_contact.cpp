// What a self-filter tells of an obstacle that touches the robot, as Markdown: a bar touches the
// simulated arm at random places, seen by a noisy, late camera whose pose is off.
//
// Usage: self_contact [--places N] [--seconds N] [--seeds N] [--update-doc doc/sources.md]

#include <cstdio>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "document.h"
#include "self_view.h"
#include "support.h"
#include "support/demo_arm.h"
#include "touch_view.h"

namespace {

std::string percent(int part, int whole) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f %%", 100.0 * part / (whole > 0 ? whole : 1));
  return text;
}

std::string millimetres(double length) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f mm", 1e3 * length);
  return text;
}

struct Config {
  ist::sim::TouchConfig touch;
  ist::sim::SelfViewConfig view;
};

// Both modes with one seed: rows of the table.
std::string rows(const ist::RobotDescription& robot,
                 const std::shared_ptr<const ist::RobotModel>& model, Config config,
                 std::uint64_t seed) {
  ist::sim::TouchConfig& touch = config.touch;
  ist::sim::SelfViewConfig& view = config.view;
  touch.seed = view.seed = seed;
  ist::IngestConfig filter;
  touch.filters = {filter};
  filter.self_filter_mode = ist::SelfFilterMode::kView;
  filter.view.noise = {touch.noise, 0.0};
  touch.filters.push_back(filter);
  const std::vector<ist::sim::TouchResult> touches = ist::sim::run_touch(robot, model, touch);

  view.position_error = touch.position_error;
  view.angle_error = touch.angle_error;
  view.resolution = touch.resolution;
  view.view = filter.view;
  view.paddings = {filter.self_filter_padding};
  std::string table;
  for (std::size_t i = 0; i < touches.size(); ++i) {
    view.mode = touch.filters[i].self_filter_mode;
    const ist::sim::SelfViewResult alone = ist::sim::run_self_view(robot, model, view).front();
    const ist::sim::TouchResult& t = touches[i];
    table += std::string("| ") + (i == 0 ? "`padding`" : "`view`") + " | " + std::to_string(seed) +
             " | " + millimetres(touches[1].offset) + " | " + percent(t.told, t.answers) + " | " +
             std::to_string(t.places_told) + " of " + std::to_string(touch.places) + " | " +
             millimetres(t.mean) + " | " + std::to_string(t.false_answers) + " of " +
             std::to_string(t.free_answers) + " | " + std::to_string(alone.contacts) + " of " +
             std::to_string(alone.answers) + " | " + std::to_string(alone.phantoms) + " |\n";
  }
  return table;
}

}  // namespace

int main(int argc, char** argv) {
  Config config;
  ist::benchmark::Arguments arguments(argc, argv);
  config.touch.places = static_cast<int>(arguments.number("places", config.touch.places));
  config.view.duration = arguments.number("seconds", config.view.duration);
  const std::size_t seeds = arguments.count("seeds", 4);
  const std::string document = arguments.text("update-doc");
  arguments.rest();
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<std::future<std::string>> runs;
  for (std::size_t seed = 1; seed <= seeds; ++seed) {
    runs.push_back(
        std::async(std::launch::async, rows, std::cref(robot), std::cref(model), config, seed));
  }
  std::string table =
      "| mode | seed | correction at the arm | told while it touches | places | mean distance told "
      "| told at 5 cm and more | alone: false contacts | alone: points not filtered |\n"
      "|---|---|---|---|---|---|---|---|---|\n";
  for (std::future<std::string>& run : runs) table += run.get();
  std::printf("%s", table.c_str());
  const bool fails =
      !document.empty() && !ist::benchmark::write_table(document, "self contact", table);
  return fails ? 1 : 0;
}
