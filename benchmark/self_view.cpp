// The padding that the self-filter needs, and touches that it must not drown, as Markdown. The
// simulated arm moves in view of its noisy, late camera. First the scene is empty otherwise: every
// obstacle that queries find is false. Then a bar touches the arm at random places, seen by a
// camera whose pose is off.

#include "self_view.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "support.h"
#include "support/demo_arm.h"
#include "touch_view.h"

namespace {

using ist::benchmark::text_of;
using ist::sim::SelfViewConfig;
using ist::sim::SelfViewResult;

struct Case {
  double noise;   // [m] standard deviation
  double flying;  // share of the pixels at edges
};
constexpr Case kCases[] = {{0.0, 0.0}, {0.002, 0.0}, {0.005, 0.0}, {0.01, 0.0}, {0.005, 0.3}};
constexpr std::size_t kSeeds = 2;

struct Robot {
  ist::RobotDescription description = ist::test::demo_robot();
  std::shared_ptr<const ist::RobotModel> model = ist::build_robot_model(description, {});
};

std::string view_table(const Robot& robot, SelfViewConfig config) {
  config.paddings = {0.01, 0.02, 0.03, 0.04, 0.06};
  const double usual = ist::IngestConfig().self_filter_padding;
  std::string table = "| noise |", rule = "|---|";
  for (const double padding : config.paddings) {
    table += text_of(" padding %.0f mm%s |", 1e3 * padding, padding == usual ? " (default)" : "");
    rule += "---|";
  }
  table += "\n" + rule + "\n";
  std::uint64_t points = 0;  // on the robot, in one run
  int answers = 0;
  for (const Case& c : kCases) {
    config.noise = c.noise;
    config.flying_pixels = c.flying;
    table += text_of("| %.0f mm", 1e3 * c.noise);
    if (c.flying > 0.0) table += text_of(", %.0f %% flying pixels", 100.0 * c.flying);
    for (const SelfViewResult& r :
         ist::sim::run_self_view(robot.description, robot.model, config)) {
      points = std::max(points, r.on_robot + r.phantoms);
      answers = std::max(answers, r.answers);
      table += " | " + std::to_string(r.phantoms) + " / " + std::to_string(r.contacts);
    }
    table += " |\n";
  }
  return table + "\n" + std::to_string(points) + " points on the robot at most, " +
         std::to_string(answers) + " answers.\n";
}

// Both modes with one seed: rows of the table.
std::string touch_rows(const Robot& robot, SelfViewConfig view, std::uint64_t seed) {
  ist::sim::TouchConfig touch;
  touch.seed = view.seed = seed;
  ist::IngestConfig filter;
  touch.filters = {filter};
  filter.self_filter_mode = ist::SelfFilterMode::kView;
  filter.view.noise = {touch.noise, 0.0};
  touch.filters.push_back(filter);
  const auto touches = ist::sim::run_touch(robot.description, robot.model, touch);

  view.position_error = touch.position_error;
  view.angle_error = touch.angle_error;
  view.resolution = touch.resolution;
  view.view = filter.view;
  view.paddings = {filter.self_filter_padding};
  std::string table;
  for (std::size_t i = 0; i < touches.size(); ++i) {
    view.mode = touch.filters[i].self_filter_mode;
    const SelfViewResult alone =
        ist::sim::run_self_view(robot.description, robot.model, view).front();
    const ist::sim::TouchResult& t = touches[i];
    table += text_of(
        "| `%s` | %llu | %.1f mm | %.1f %% | %d of %d | %.1f mm | %d of %d | %d of %d | %llu |\n",
        i == 0 ? "padding" : "view", static_cast<unsigned long long>(seed), 1e3 * touches[1].offset,
        100.0 * t.told / std::max(1, t.answers), t.places_told, touch.places, 1e3 * t.mean,
        t.false_answers, t.free_answers, alone.contacts, alone.answers,
        static_cast<unsigned long long>(alone.phantoms));
  }
  return table;
}

std::string touch_table(const Robot& robot, const SelfViewConfig& config) {
  std::array<std::string, kSeeds> rows;
  ist::benchmark::for_each(kSeeds,
                           [&](std::size_t i) { rows[i] = touch_rows(robot, config, i + 1); });
  std::string table =
      "| mode | seed | correction at the arm | told while it touches | places | mean distance told "
      "| told at 5 cm and more | alone: false contacts | alone: points not filtered |\n"
      "|---|---|---|---|---|---|---|---|---|\n";
  for (const std::string& row : rows) table += row;
  return table;
}

}  // namespace

int main(int argc, char** argv) {
  SelfViewConfig config;
  ist::benchmark::CommandLine line("What the self-filter leaves over, and what it drowns.");
  line.add_option("--seconds", config.duration, "How long the arm moves alone");
  line.read(argc, argv);
  const Robot robot;
  const int failed = line.publish("self view", view_table(robot, config));
  return line.publish("self contact", touch_table(robot, config)) + failed;
}
