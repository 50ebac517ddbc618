// How well a robot dodges that follows the answers, as Markdown: 50 seeded scenes in the simulator,
// each without avoidance, with the speed scale alone, with the blended repulsion alone, and with
// the speed scale beside the repulsion and beside the nearest pair's direction.
//
// Usage: closed_loop [--first SEED] [--count N] [--threads N] [--noise MM] [--each] [--self]
//                    [--save FILE] [--from FILE]... [--update-doc doc/benchmark.md]
//   --save  appends the measurements to a file
//   --from  takes measurements from such files, in place of running the scenes: so that several
//           machines share the work
//   --self  the repulsion only, and the distances between links of the arm

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
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
constexpr std::size_t kSelfMode = 3;  // blend and speed scale

struct SceneResult {
  ClosedLoopResult modes[kModeCount];
};

void print_each(const std::vector<SceneResult>& results, std::uint64_t first) {
  std::printf("| seed | avoidance | smallest distance | at | between | goals |\n");
  std::printf("|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < results.size(); ++i) {
    for (std::size_t m = 0; m < kModeCount; ++m) {
      const ClosedLoopResult& r = results[i].modes[m];
      std::printf("| %d | %s | %.1f mm | %.2f s | %s, %s | %d |\n", static_cast<int>(first + i),
                  kModes[m].name, 1e3 * r.smallest_distance, r.when, r.link.c_str(),
                  r.obstacle.c_str(), r.goals);
    }
  }
}

void print_self(const std::vector<SceneResult>& results, std::uint64_t first) {
  for (std::size_t i = 0; i < results.size(); ++i) {
    const ClosedLoopResult& r = results[i].modes[kSelfMode];
    std::printf("seed %d: obstacles %.1f mm, own links %.1f mm\n", static_cast<int>(first + i),
                1e3 * r.smallest_distance, 1e3 * r.smallest_self_distance);
  }
}

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

// One line for each scene and mode.
bool save(const std::string& path, const std::vector<SceneResult>& results, std::uint64_t first) {
  std::ofstream file(path, std::ios::app);
  file.precision(17);
  for (std::size_t i = 0; i < results.size(); ++i) {
    for (std::size_t m = 0; m < kModeCount; ++m) {
      const ClosedLoopResult& r = results[i].modes[m];
      const double time = std::isfinite(r.task_time) ? r.task_time : -1.0;
      file << first + i << ' ' << m << ' ' << r.smallest_distance << ' ' << time << ' '
           << r.speed_at_touch << ' ' << r.goals << ' ' << r.acceleration_noise << ' '
           << r.largest_command_step << '\n';
    }
  }
  return static_cast<bool>(file);
}

// False: the file cannot be read, or lacks a seed from `first` on.
bool load(const std::string& path, std::uint64_t first, std::vector<SceneResult>* results,
          std::size_t* lines) {
  std::ifstream file(path);
  if (!file) return false;
  std::uint64_t seed = 0;
  std::size_t mode = 0;
  ClosedLoopResult r;
  while (file >> seed >> mode >> r.smallest_distance >> r.task_time >> r.speed_at_touch >>
         r.goals >> r.acceleration_noise >> r.largest_command_step) {
    if (seed < first || seed - first >= results->size() || mode >= kModeCount) return false;
    if (r.task_time < 0.0) r.task_time = std::numeric_limits<double>::infinity();
    (*results)[seed - first].modes[mode] = r;
    ++*lines;
  }
  return true;
}

struct Options {
  std::uint64_t first = 1;
  std::size_t count = 50;
  int threads = 1;
  double noise = -1.0;  // [m] negative: the cameras' own
  std::string document, save;
  std::vector<std::string> from;
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
    } else if (std::strcmp(argv[i], "--save") == 0 && has_value) {
      options->save = argv[++i];
    } else if (std::strcmp(argv[i], "--from") == 0 && has_value) {
      options->from.emplace_back(argv[++i]);
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

// One scene in all modes.
SceneResult run_scene(const ist::RobotDescription& robot,
                      const std::shared_ptr<const ist::RobotModel>& model, std::uint64_t seed,
                      const Options& options) {
  ist::sim::ClosedLoopConfig config;
  const auto nominal = [&](const ist::sim::Scene& scene) {
    return ist::sim::nominal_motion(robot, scene, config.controller);
  };
  ist::sim::Scene scene = ist::sim::make_scene(robot, seed, {}, nominal);
  for (ist::sim::DepthCameraConfig& camera : scene.cameras) {
    if (options.noise >= 0.0) camera.noise = options.noise;
  }
  config.check_self = options.only_self;
  SceneResult result;
  for (std::size_t m = 0; m < kModeCount; ++m) {
    config.avoidance = kModes[m].avoidance;
    config.scale_speed = kModes[m].scale_speed;
    if (options.only_self && m != kSelfMode) continue;
    result.modes[m] = ist::sim::run_closed_loop(robot, model, scene, seed, config);
  }
  return result;
}

void run_scenes(const Options& options, std::vector<SceneResult>* results) {
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < options.count; i = next++) {
      (*results)[i] = run_scene(robot, model, options.first + i, options);
    }
  };
  std::vector<std::thread> pool;
  for (int t = 1; t < options.threads; ++t) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();
}

// The measurements of earlier runs. @returns false, with a message, unless all are there
bool load_scenes(const Options& options, std::vector<SceneResult>* results) {
  std::size_t loaded = 0;
  for (const std::string& path : options.from) {
    if (load(path, options.first, results, &loaded)) continue;
    std::fprintf(stderr, "%s: no measurements of these seeds\n", path.c_str());
    return false;
  }
  if (loaded == options.count * kModeCount) return true;
  std::fprintf(stderr, "%zu measurements instead of %zu\n", loaded, options.count * kModeCount);
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  if (!parse(argc, argv, &options)) return 1;

  std::vector<SceneResult> results(options.count);
  if (options.from.empty()) {
    run_scenes(options, &results);
  } else if (!load_scenes(options, &results)) {
    return 1;
  }
  if (!options.save.empty() && !save(options.save, results, options.first)) return 1;

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
