// The closed loop where obstacles stop on the arm's way and are hidden from both cameras half of
// the time, without and with memory: collisions by the true shapes.
//
// Usage: hidden [--first SEED] [--count N] [--threads N] [--update-doc FILE]

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "closed_loop.h"
#include "document.h"
#include "hidden_scene.h"
#include "support.h"
#include "support/demo_arm.h"

namespace {

using ist::sim::ClosedLoopResult;

constexpr std::size_t kModes = 2;
constexpr const char* kNames[kModes] = {"without memory", "with memory"};
constexpr double kStanding = 0.02;  // [rad/s] a slower arm is not called moving

using Result = std::array<ClosedLoopResult, kModes>;

std::string table(const std::vector<Result>& results) {
  std::string text =
      "| | scenes | collisions | with a moving arm | smallest true distance, median | tasks done | "
      "goals |\n|---|---|---|---|---|---|---|\n";
  for (std::size_t m = 0; m < kModes; ++m) {
    int collisions = 0, moving = 0, done = 0, goals = 0;
    std::vector<double> distance;
    for (const Result& result : results) {
      const ClosedLoopResult& r = result[m];
      collisions += r.smallest_distance <= 0.0 ? 1 : 0;
      moving += r.smallest_distance <= 0.0 && r.speed_at_touch > kStanding ? 1 : 0;
      done += r.goals >= ist::sim::Scene().task ? 1 : 0;
      goals += r.goals;
      distance.push_back(1e3 * r.smallest_distance);
    }
    std::array<char, 200> row{};
    std::snprintf(row.data(), row.size(), "| %s | %zu | %d | %d | %.0f mm | %d | %d |\n", kNames[m],
                  results.size(), collisions, moving, ist::benchmark::quantile(distance, 0.5), done,
                  goals);
    text += row.data();
  }
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  ist::benchmark::Arguments arguments(argc, argv);
  const auto first = arguments.count("first", 1), count = arguments.count("count", 50);
  const auto threads = arguments.count("threads", 1);
  const std::string document = arguments.text("update-doc");
  arguments.rest();
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<Result> results(count);
  ist::benchmark::for_each(count, threads, [&](std::size_t i) {
    ist::sim::ClosedLoopConfig config;
    config.memory.decay = 5.0;
    const auto nominal = [&](const ist::sim::Scene& scene) {
      return ist::sim::nominal_motion(robot, scene, config.controller);
    };
    const ist::sim::SceneRules rules;
    const ist::sim::Scene scene = ist::sim::hidden_half_of_the_time(
        ist::sim::make_scene(robot, first + i, rules, nominal), rules, {});
    for (std::size_t m = 0; m < kModes; ++m) {
      config.remember = m == 1;
      results[i][m] = ist::sim::run_closed_loop(robot, model, scene, first + i, config);
    }
  });
  std::printf("\n%s", table(results).c_str());
  if (document.empty()) return 0;
  return ist::benchmark::write_table(document, "hidden obstacles", table(results)) ? 0 : 1;
}
