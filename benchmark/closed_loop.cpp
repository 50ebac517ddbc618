// How well a robot dodges that follows the answers, as Markdown: 50 seeded scenes in the simulator,
// each without avoidance, with the blended repulsion, and with the nearest pair's direction.
//
// Usage: closed_loop [--first SEED] [--count N] [--threads N] [--noise MM] [--each] [--self]
//                    [--update-doc doc/dodge.md]
//   --self  the blend only, and the distances between links of the arm

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
#include "support.h"
#include "support/demo_arm.h"

namespace {

using ist::sim::Avoidance;
using ist::sim::ClosedLoopResult;

constexpr Avoidance kModes[] = {Avoidance::kNone, Avoidance::kBlend, Avoidance::kNearest};
constexpr const char* kNames[] = {"none", "blend (`repulsion`)", "nearest pair (`direction`)"};

struct SceneResult {
  ClosedLoopResult modes[3];
};

void print_each(const std::vector<SceneResult>& results, std::uint64_t first) {
  std::printf("| seed | avoidance | smallest distance | at | between | goals |\n");
  std::printf("|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < results.size(); ++i) {
    for (std::size_t m = 0; m < 3; ++m) {
      const ClosedLoopResult& r = results[i].modes[m];
      std::printf("| %d | %s | %.1f mm | %.2f s | %s, %s | %d |\n", static_cast<int>(first + i),
                  kNames[m], 1e3 * r.smallest_distance, r.when, r.link.c_str(), r.obstacle.c_str(),
                  r.goals);
    }
  }
}

void print_self(const std::vector<SceneResult>& results, std::uint64_t first) {
  for (std::size_t i = 0; i < results.size(); ++i) {
    const ClosedLoopResult& r = results[i].modes[1];
    std::printf("seed %d: obstacles %.1f mm, own links %.1f mm\n", static_cast<int>(first + i),
                1e3 * r.smallest_distance, 1e3 * r.smallest_self_distance);
  }
}

std::string table(const std::vector<SceneResult>& results) {
  std::string text =
      "| avoidance | collisions | smallest true distance, least / median | task done | goals | "
      "acceleration noise | command steps |\n|---|---|---|---|---|---|---|\n";
  for (std::size_t m = 0; m < 3; ++m) {
    int collisions = 0, done = 0, goals = 0;
    std::vector<double> distance, noise, steps;
    for (const SceneResult& result : results) {
      const ClosedLoopResult& r = result.modes[m];
      collisions += r.smallest_distance <= 0.0 ? 1 : 0;
      done += r.goals >= ist::sim::Scene().task ? 1 : 0;
      goals += r.goals;
      distance.push_back(1e3 * r.smallest_distance);
      noise.push_back(r.acceleration_noise);
      steps.push_back(r.largest_command_step);
    }
    std::array<char, 256> row{};
    std::snprintf(row.data(), row.size(),
                  "| %s | %d | %.0f / %.0f mm | %d | %d | %.2f rad/s^2 | %.3f rad/s |\n", kNames[m],
                  collisions, *std::min_element(distance.begin(), distance.end()),
                  ist::benchmark::quantile(distance, 0.5), done, goals, ist::benchmark::mean(noise),
                  ist::benchmark::quantile(steps, 0.5));
    text += row.data();
  }
  return text;
}

struct Options {
  std::uint64_t first = 1;
  std::size_t count = 50;
  int threads = 1;
  double noise = -1.0;  // [m] negative: the cameras' own
  std::string document;
  bool each = false, only_self = false;
};

// False: an argument is unknown, which is printed.
bool parse(int argc, char** argv, Options* options) {
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (std::strcmp(argv[i], "--each") == 0) {
      options->each = true;
    } else if (std::strcmp(argv[i], "--self") == 0) {
      options->only_self = true;
    } else if (std::strcmp(argv[i], "--first") == 0 && has_value) {
      options->first = static_cast<std::uint64_t>(std::atoll(argv[++i]));
    } else if (std::strcmp(argv[i], "--count") == 0 && has_value) {
      options->count = static_cast<std::size_t>(std::atoll(argv[++i]));
    } else if (std::strcmp(argv[i], "--update-doc") == 0 && has_value) {
      options->document = argv[++i];
    } else if (std::strcmp(argv[i], "--threads") == 0 && has_value) {
      options->threads = std::atoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--noise") == 0 && has_value) {
      options->noise = 1e-3 * std::atof(argv[++i]);
    } else {
      std::fprintf(stderr, "unknown argument: %s\n", argv[i]);
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  if (!parse(argc, argv, &options)) return 1;

  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<SceneResult> results(options.count);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < options.count; i = next++) {
      ist::sim::ClosedLoopConfig config;
      const auto nominal = [&](const ist::sim::Scene& scene) {
        return ist::sim::nominal_motion(robot, scene, config.controller);
      };
      const std::uint64_t seed = options.first + i;
      ist::sim::Scene scene = ist::sim::make_scene(robot, seed, {}, nominal);
      for (ist::sim::DepthCameraConfig& camera : scene.cameras) {
        if (options.noise >= 0.0) camera.noise = options.noise;
      }
      config.check_self = options.only_self;
      for (std::size_t m = 0; m < 3; ++m) {
        config.avoidance = kModes[m];
        if (options.only_self && config.avoidance != Avoidance::kBlend) continue;
        results[i].modes[m] = ist::sim::run_closed_loop(robot, model, scene, seed, config);
      }
    }
  };
  std::vector<std::thread> pool;
  for (int t = 1; t < options.threads; ++t) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();

  if (options.only_self) {
    print_self(results, options.first);
    return 0;
  }
  if (options.each) print_each(results, options.first);
  std::printf("\n%s", table(results).c_str());
  const bool fails = !options.document.empty() &&
                     !ist::benchmark::write_table(options.document, "closed loop", table(results));
  return fails ? 1 : 0;
}
