// The closed loop where obstacles stop on the arm's way and are hidden from both cameras half of
// the time, without and with memory: collisions by the true shapes.
//
// Usage: hidden [--first SEED] [--count N] [--threads N] [--each] [--update-doc FILE]

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
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

struct Options {
  std::uint64_t first = 1;
  std::size_t count = 50, threads = 1;
  bool each = false;
  std::string document;
};

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    if (name == "--each") {
      options.each = true;
      continue;
    }
    if (name == "--first") options.first = std::strtoull(value, nullptr, 10);
    if (name == "--count") options.count = std::strtoul(value, nullptr, 10);
    if (name == "--threads") options.threads = std::strtoul(value, nullptr, 10);
    if (name == "--update-doc") options.document = value;
    ++i;
  }
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = parse(argc, argv);
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<Result> results(options.count);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < options.count; i = next++) {
      ist::sim::ClosedLoopConfig config;
      config.memory.decay = 5.0;
      const auto nominal = [&](const ist::sim::Scene& scene) {
        return ist::sim::nominal_motion(robot, scene, config.controller);
      };
      const std::uint64_t seed = options.first + i;
      const ist::sim::SceneRules rules;
      const ist::sim::Scene scene = ist::sim::hidden_half_of_the_time(
          ist::sim::make_scene(robot, seed, rules, nominal), rules, {});
      for (std::size_t m = 0; m < kModes; ++m) {
        config.remember = m == 1;
        results[i][m] = ist::sim::run_closed_loop(robot, model, scene, seed, config);
        const ClosedLoopResult& r = results[i][m];
        if (!options.each) continue;
        std::printf("seed %d, %s: %.1f mm at %.2f s, %s, %s; %d goals\n", static_cast<int>(seed),
                    kNames[m], 1e3 * r.smallest_distance, r.when, r.link.c_str(),
                    r.obstacle.c_str(), r.goals);
        std::fflush(stdout);
      }
    }
  };
  std::vector<std::thread> pool;
  for (std::size_t t = 1; t < options.threads; ++t) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();
  std::printf("\n%s", table(results).c_str());
  if (options.document.empty()) return 0;
  return ist::benchmark::write_table(options.document, "hidden obstacles", table(results)) ? 0 : 1;
}
