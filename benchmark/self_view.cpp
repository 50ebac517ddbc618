// The padding that the self-filter needs, as Markdown. The simulated arm moves in view of its
// noisy, late camera, and the scene is empty otherwise: every obstacle that queries find is false.
//
// Usage: self_view [--seconds N] [--update-doc doc/sources.md]

#include "self_view.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <string>
#include <vector>

#include "document.h"
#include "ist_proximity/cloud/ingest.h"
#include "support.h"
#include "support/demo_arm.h"

namespace {

constexpr double kPaddings[] = {0.01, 0.02, 0.03, 0.04, 0.06};  // [m]

struct Case {
  double noise;   // [m] standard deviation
  double flying;  // share of the pixels at edges
};
constexpr Case kCases[] = {{0.0, 0.0}, {0.002, 0.0}, {0.005, 0.0}, {0.01, 0.0}, {0.005, 0.3}};

std::string millimetres(double length) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f mm", 1e3 * length);
  return text;
}

std::string head() {
  const double usual = ist::IngestConfig().self_filter_padding;
  std::string names = "| noise |", rule = "|---|";
  for (const double padding : kPaddings) {
    names += " padding " + millimetres(padding) + (padding == usual ? " (default) |" : " |");
    rule += "---|";
  }
  return names + "\n" + rule + "\n";
}

std::string row(const Case& c, const std::vector<ist::sim::SelfViewResult>& results) {
  std::string line = "| " + millimetres(c.noise);
  if (c.flying > 0.0) {
    line += ", " + std::to_string(static_cast<int>(100.0 * c.flying + 0.5)) + " % flying pixels";
  }
  for (const ist::sim::SelfViewResult& r : results) {
    line += " | " + std::to_string(r.phantoms) + " / " + std::to_string(r.contacts);
  }
  return line + " |\n";
}

}  // namespace

int main(int argc, char** argv) {
  ist::sim::SelfViewConfig config;
  config.paddings.assign(std::begin(kPaddings), std::end(kPaddings));
  ist::benchmark::Arguments arguments(argc, argv);
  config.duration = arguments.number("seconds", config.duration);
  const std::string document = arguments.text("update-doc");
  arguments.rest();
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::string table = head();
  std::uint64_t points = 0;  // on the robot, in one run
  int answers = 0;
  for (const Case& c : kCases) {
    config.noise = c.noise;
    config.flying_pixels = c.flying;
    const auto results = ist::sim::run_self_view(robot, model, config);
    for (const ist::sim::SelfViewResult& r : results) {
      points = std::max(points, r.on_robot + r.phantoms);
      answers = std::max(answers, r.answers);
    }
    table += row(c, results);
  }
  table += "\n" + std::to_string(points) + " points on the robot at most, " +
           std::to_string(answers) + " answers.\n";
  std::printf("%s", table.c_str());
  const bool fails =
      !document.empty() && !ist::benchmark::write_table(document, "self view", table);
  return fails ? 1 : 0;
}
