// How well a robot dodges that follows the answers, as Markdown: 50 seeded scenes in the simulator,
// each without avoidance, with the speed scale alone, with the blended repulsion alone, and with
// the speed scale beside the repulsion and beside the nearest pair's direction.
//
// Usage: closed_loop [--first SEED] [--count N] [--threads N] [--noise MM]
//                    [--update-doc doc/benchmark.md]

#include <algorithm>
#include <array>
#include <cstdio>
#include <iterator>
#include <string>
#include <vector>

#include "closed_loop.h"
#include "document.h"
#include "support.h"
#include "support/demo_arm.h"

namespace {

using ist::sim::Avoidance;
using ist::sim::ClosedLoopResult;

constexpr double kStanding = 0.02;  // [rad/s] a slower arm is not called moving

struct Mode {
  const char* name;
  Avoidance avoidance;
  bool scale_speed;
};

constexpr Mode kModes[] = {
    {"none", Avoidance::kNone, false},
    {"`speed_scale` alone", Avoidance::kSlow, true},
    {"blend (`repulsion`) alone", Avoidance::kBlend, false},
    {"blend and `speed_scale`", Avoidance::kBlend, true},
    {"nearest pair (`direction`) and `speed_scale`", Avoidance::kNearest, true}};
constexpr std::size_t kModeCount = std::size(kModes);

struct SceneResult {
  ClosedLoopResult modes[kModeCount];
};

std::string table(const std::vector<SceneResult>& results) {
  std::string text =
      "| avoidance | collisions | with a moving arm | smallest true distance, least / median | "
      "task "
      "done | after, median | goals | acceleration noise | command steps |\n"
      "|---|---|---|---|---|---|---|---|---|\n";
  for (std::size_t m = 0; m < kModeCount; ++m) {
    int collisions = 0, moving = 0, done = 0, goals = 0;
    std::vector<double> distance, time, noise, steps;
    for (const SceneResult& result : results) {
      const ClosedLoopResult& r = result.modes[m];
      collisions += r.smallest_distance <= 0.0 ? 1 : 0;
      moving += r.smallest_distance <= 0.0 && r.speed_at_touch > kStanding ? 1 : 0;
      time.push_back(r.task_time);
      done += r.goals >= ist::sim::Scene().task ? 1 : 0;
      goals += r.goals;
      distance.push_back(1e3 * r.smallest_distance);
      noise.push_back(r.acceleration_noise);
      steps.push_back(r.largest_command_step);
    }
    std::array<char, 256> row{};
    std::snprintf(
        row.data(), row.size(),
        "| %s | %d | %d | %.0f / %.0f mm | %d | %.1f s | %d | %.2f rad/s^2 | %.3f rad/s |\n",
        kModes[m].name, collisions, moving, *std::min_element(distance.begin(), distance.end()),
        ist::benchmark::quantile(distance, 0.5), done, ist::benchmark::quantile(time, 0.5), goals,
        ist::benchmark::mean(noise), ist::benchmark::quantile(steps, 0.5));
    text += row.data();
  }
  return text;
}

// One scene in all modes.
SceneResult run_scene(const ist::RobotDescription& robot,
                      const std::shared_ptr<const ist::RobotModel>& model, std::uint64_t seed,
                      double noise) {
  ist::sim::ClosedLoopConfig config;
  const auto nominal = [&](const ist::sim::Scene& scene) {
    return ist::sim::nominal_motion(robot, scene, config.controller);
  };
  ist::sim::Scene scene = ist::sim::make_scene(robot, seed, {}, nominal);
  for (ist::sim::DepthCameraConfig& camera : scene.cameras) {
    if (noise >= 0.0) camera.noise = noise;
  }
  SceneResult result;
  for (std::size_t m = 0; m < kModeCount; ++m) {
    config.avoidance = kModes[m].avoidance;
    config.scale_speed = kModes[m].scale_speed;
    result.modes[m] = ist::sim::run_closed_loop(robot, model, scene, seed, config);
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  ist::benchmark::Arguments arguments(argc, argv);
  const auto first = arguments.count("first", 1), count = arguments.count("count", 50);
  const auto threads = arguments.count("threads", 1);
  const double noise = 1e-3 * arguments.number("noise", -1.0);  // [m] negative: the cameras' own
  const std::string document = arguments.text("update-doc");
  arguments.rest();
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<SceneResult> results(count);
  ist::benchmark::for_each(count, threads, [&](std::size_t i) {
    results[i] = run_scene(robot, model, first + i, noise);
  });
  std::printf("\n%s", table(results).c_str());
  if (document.empty()) return 0;
  return ist::benchmark::write_table(document, "closed loop", table(results)) ? 0 : 1;
}
