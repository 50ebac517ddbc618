// How safe an arm is that follows the answers, as Markdown: seeded scenes in the simulator, of each
// kind in turn: bodies that cross its path, bodies that stand in it, people who walk past, bodies
// that are hidden from both cameras half of the time, and goals between which the arm would touch
// itself. Each is run without avoidance, with the speed scale alone, with the repulsion alone, and
// with the velocity filter, which is told how fast bodies of this kind move and how long they hide;
// and as many starts within the stop distance.
//
// Usage: closed_loop [--first SEED] [--count N] [--threads N] [--noise MM]
//                    [--hidden-age S] [--only "velocity filter"] [--update-doc doc/benchmark.md]
//        closed_loop --filter-runs 30000 [--update-doc doc/benchmark.md]
// The second one measures how long the filter takes.

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "closed_loop.h"
#include "document.h"
#include "filter_time.h"
#include "hidden_scene.h"
#include "support.h"
#include "support/demo_arm.h"

namespace {

using ist::sim::Avoidance;
using ist::sim::ClosedLoopResult;
using ist::sim::Scene;
using ist::sim::SceneRules;

constexpr double kLeft = 0.06;     // [m] starts that are as far away at the end have left
constexpr double kDriven = 0.005;  // [m/s] what comes nearer more slowly is not called driven

constexpr const char* kKinds[] = {"crossing", "standing", "people", "hidden", "itself"};
constexpr std::size_t kKindCount = std::size(kKinds);
constexpr std::size_t kStanding = 1, kPeople = 2, kHidden = 3, kItself = 4;

struct Mode {
  const char* name;
  Avoidance avoidance;
  bool scale_speed;
};
constexpr Mode kModes[] = {{"none", Avoidance::kNone, false},
                           {"`speed_scale` alone", Avoidance::kSlow, true},
                           {"`repulsion` alone", Avoidance::kBlend, false},
                           {"velocity filter", Avoidance::kFilter, false}};
constexpr std::size_t kModeCount = std::size(kModes);

struct SceneResult {
  std::size_t kind = 0;
  ClosedLoopResult modes[kModeCount], starts[kModeCount];
};

bool is_asked(std::size_t mode, const std::string& only) {
  return only.empty() || only == kModes[mode].name;
}

std::string table(const std::vector<SceneResult>& results, const std::string& only) {
  std::string text = "| avoidance | contacts | driven into:";
  for (const char* kind : kKinds) text += std::string(" ") + kind + ",";
  text.back() = ' ';
  text +=
      "| smallest true distance, median | task done | after, median of these | near starts that "
      "left "
      "| contacts there |\n|---|---|---|---|---|---|---|---|\n";
  for (std::size_t m = 0; m < kModeCount; ++m) {
    if (!is_asked(m, only)) continue;
    int contacts = 0, done = 0, left = 0, touched = 0;
    std::array<int, kKindCount> driven{};
    std::vector<double> distance, time;
    for (const SceneResult& result : results) {
      const ClosedLoopResult& r = result.modes[m];
      contacts += std::min(r.smallest_distance, r.own_distance) <= 0.0 ? 1 : 0;
      driven[result.kind] += r.driven_at_touch > kDriven ? 1 : 0;
      done += r.goals >= Scene().task ? 1 : 0;
      if (r.goals >= Scene().task) time.push_back(r.task_time);
      distance.push_back(1e3 * r.smallest_distance);
      left += result.starts[m].last_distance > kLeft ? 1 : 0;
      touched += result.starts[m].driven_at_touch > kDriven ? 1 : 0;
    }
    std::array<char, 256> row{};
    std::snprintf(
        row.data(), row.size(),
        "| %s | %d | %d, %d, %d, %d, %d | %.0f mm | %d of %zu | %.1f s | %d of %zu | %d |\n",
        kModes[m].name, contacts, driven[0], driven[1], driven[2], driven[3], driven[4],
        ist::benchmark::quantile(distance, 0.5), done, results.size(),
        ist::benchmark::quantile(time, 0.5), left, results.size(), touched);
    text += row.data();
  }
  return text;
}

SceneRules rules_of(std::size_t kind,
                    const std::function<double(const Eigen::VectorXd&)>& own_distance) {
  SceneRules rules;
  if (kind == kStanding) {
    rules.obstacles = 0;
    rules.clutter = 3;
  } else if (kind == kPeople) {
    rules.obstacles = 0;
    rules.people = 3;
    rules.aim_interval = 4.0;
  } else if (kind == kItself) {
    rules.obstacles = 0;
    rules.goal_clearance = 0.12;
    rules.own_distance = own_distance;
  }
  return rules;
}

// [m/s] The fastest that bodies of a kind of scenes come.
double speed_of(const SceneRules& rules) {
  if (rules.people > 0) return rules.walking_speed;
  return rules.obstacles > 0 ? rules.max_speed : 0.0;
}

// One line for each run, as it ends: the table has no seeds.
void tell(std::uint64_t seed, std::size_t mode, const SceneResult& result) {
  const ClosedLoopResult &scene = result.modes[mode], &start = result.starts[mode];
  std::fprintf(stderr,
               "seed %llu, %s, %s: %d goals, %.0f mm from %s (%s), driven %.1f mm/s; "
               "start: %.0f mm at the end, driven %.1f mm/s\n",
               static_cast<unsigned long long>(seed), kKinds[result.kind], kModes[mode].name,
               scene.goals, 1e3 * scene.smallest_distance, scene.obstacle.c_str(),
               scene.link.c_str(), 1e3 * scene.driven_at_touch, 1e3 * start.last_distance,
               1e3 * start.driven_at_touch);
}

// One scene in all modes.
SceneResult run_scene(const ist::RobotDescription& robot,
                      const std::shared_ptr<const ist::RobotModel>& model, std::uint64_t seed,
                      double noise, double hidden_age, const std::string& only) {
  ist::sim::ClosedLoopConfig config;
  const auto nominal = [&](const Scene& scene) {
    return ist::sim::nominal_motion(robot, scene, config.controller);
  };
  SceneResult result;
  result.kind = seed % kKindCount;
  const ist::sim::Arm arm(robot, ist::sim::demo_arm());
  ist::QueryConfig near;
  near.max_distance = 0.03;  // more than the goals of a folded arm leave
  ist::sim::OwnDistances own(robot, model, near);
  const SceneRules rules =
      rules_of(result.kind, [&](const Eigen::VectorXd& q) { return own.least(arm.link_poses(q)); });
  Scene scene = ist::sim::make_scene(robot, seed, rules, nominal);
  if (speed_of(rules) == 0.0) scene.duration = 0.0;  // nothing passes
  if (result.kind == kHidden) scene = ist::sim::hidden_half_of_the_time(scene, rules, {});
  Scene start = ist::sim::make_near_start(robot, seed, nominal);
  for (Scene* one : {&scene, &start}) {
    for (ist::sim::DepthCameraConfig& camera : one->cameras) {
      if (noise >= 0.0) camera.noise = noise;
    }
  }
  config.remember = true;
  config.memory.decay = 5.0;
  config.control_period = 10;  // as the filter's usual rate of commands
  for (std::size_t m = 0; m < kModeCount; ++m) {
    if (!is_asked(m, only)) continue;
    config.avoidance = kModes[m].avoidance;
    config.scale_speed = kModes[m].scale_speed;
    config.rows.obstacle_speed = config.rows.age = 0.0;
    config.leave_speed = config.controller.task_speed;
    result.starts[m] = ist::sim::run_closed_loop(robot, model, start, seed, config);
    config.rows.obstacle_speed = speed_of(rules);
    config.rows.age = result.kind == kHidden ? hidden_age : 0.0;
    config.leave_speed = 0.0;
    result.modes[m] = ist::sim::run_closed_loop(robot, model, scene, seed, config);
    tell(seed, m, result);
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  ist::benchmark::Arguments arguments(argc, argv);
  const auto first = arguments.count("first", 1), count = arguments.count("count", 200);
  const auto threads = arguments.count("threads", 1);
  const double noise = 1e-3 * arguments.number("noise", -1.0);  // [m] negative: the cameras' own
  // [s] What the filter is told of how long bodies hide.
  const double hidden_age = arguments.number("hidden-age", 0.5 * ist::sim::HiddenRules().period);
  const std::string only = arguments.text("only"), document = arguments.text("update-doc");
  const auto filter_runs = arguments.count("filter-runs", 0);
  arguments.rest();
  if (filter_runs > 0) {
    const std::string text = ist::benchmark::filter_time(filter_runs);
    std::printf("%s", text.c_str());
    if (document.empty()) return 0;
    return ist::benchmark::write_table(document, "filter time", text) ? 0 : 1;
  }
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<SceneResult> results(count);
  ist::benchmark::for_each(count, threads, [&](std::size_t i) {
    results[i] = run_scene(robot, model, first + i, noise, hidden_age, only);
  });
  std::printf("\n%s", table(results, only).c_str());
  if (document.empty()) return 0;
  return ist::benchmark::write_table(document, "closed loop", table(results, only)) ? 0 : 1;
}
