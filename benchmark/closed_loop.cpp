// How safe an arm is that follows the answers, as Markdown: seeded scenes in the simulator, of each
// kind in turn: bodies that cross its path, bodies that stand in it, people who walk past, bodies
// that are hidden from both cameras half of the time, and goals between which the arm would touch
// itself. Each is run without avoidance, with the speed scale alone, with the repulsion alone, and
// with the velocity filter, which is told how fast bodies of this kind move and how long they hide;
// and as many starts within the stop distance.
// With --memory instead: scenes whose obstacles are hidden half of the time, with the arm that
// dodges, without and with memory.

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "closed_loop.h"
#include "hidden_scene.h"
#include "support.h"
#include "support/demo_arm.h"

namespace {

using ist::benchmark::quantile;
using ist::benchmark::text_of;
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

struct Options {
  std::size_t first = 1, count = 50;
  double hidden_age = 0.5 * ist::sim::HiddenRules().period;  // [s] that the filter is told
  std::string only;
  bool memory = false;

  bool asks_for(std::size_t mode) const { return only.empty() || only == kModes[mode].name; }
};

// The demo's arm.
struct Robot {
  ist::RobotDescription description = ist::test::demo_robot();
  std::shared_ptr<const ist::RobotModel> model = ist::build_robot_model(description, {});

  ClosedLoopResult run(const Scene& scene, std::uint64_t seed,
                       const ist::sim::ClosedLoopConfig& config) const {
    return ist::sim::run_closed_loop(description, model, scene, seed, config);
  }
};

struct SceneResult {
  std::size_t kind = 0;
  ClosedLoopResult modes[kModeCount], starts[kModeCount];
};

std::string row(std::size_t mode, const std::vector<SceneResult>& results) {
  int contacts = 0, done = 0, left = 0, touched = 0;
  std::array<int, kKindCount> driven{};
  std::vector<double> distance, time;
  for (const SceneResult& result : results) {
    const ClosedLoopResult &r = result.modes[mode], &start = result.starts[mode];
    contacts += std::min(r.smallest_distance, r.own_distance) <= 0.0 ? 1 : 0;
    driven[result.kind] += r.driven_at_touch > kDriven ? 1 : 0;
    done += r.goals >= Scene().task ? 1 : 0;
    if (r.goals >= Scene().task) time.push_back(r.task_time);
    distance.push_back(1e3 * r.smallest_distance);
    left += start.last_distance > kLeft ? 1 : 0;
    touched += start.driven_at_touch > kDriven ? 1 : 0;
  }
  return text_of(
      "| %s | %d | %d, %d, %d, %d, %d | %.0f mm | %d of %zu | %.1f s | %d of %zu | %d |\n",
      kModes[mode].name, contacts, driven[0], driven[1], driven[2], driven[3], driven[4],
      quantile(distance, 0.5), done, results.size(), quantile(time, 0.5), left, results.size(),
      touched);
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
SceneResult run_scene(const Robot& robot, std::uint64_t seed, const Options& options) {
  ist::sim::ClosedLoopConfig config;
  const auto nominal = [&](const Scene& scene) {
    return ist::sim::nominal_motion(robot.description, scene, config.controller);
  };
  SceneResult result;
  result.kind = seed % kKindCount;
  const ist::sim::Arm arm(robot.description, ist::sim::demo_arm());
  ist::QueryConfig near;
  near.max_distance = 0.03;  // more than the goals of a folded arm leave
  ist::sim::OwnDistances own(robot.description, robot.model, near);
  const SceneRules rules =
      rules_of(result.kind, [&](const Eigen::VectorXd& q) { return own.least(arm.link_poses(q)); });
  Scene scene = ist::sim::make_scene(robot.description, seed, rules, nominal);
  if (speed_of(rules) == 0.0) scene.duration = 0.0;  // nothing passes
  if (result.kind == kHidden) scene = ist::sim::hidden_half_of_the_time(scene, rules, {});
  const Scene start = ist::sim::make_near_start(robot.description, seed, nominal);
  config.remember = true;
  config.memory.decay = 5.0;
  config.control_period = 10;  // as the filter's usual rate of commands
  for (std::size_t m = 0; m < kModeCount; ++m) {
    if (!options.asks_for(m)) continue;
    config.avoidance = kModes[m].avoidance;
    config.scale_speed = kModes[m].scale_speed;
    config.rows.obstacle_speed = config.rows.age = 0.0;
    config.leave_speed = config.controller.task_speed;
    result.starts[m] = robot.run(start, seed, config);
    config.rows.obstacle_speed = speed_of(rules);
    config.rows.age = result.kind == kHidden ? options.hidden_age : 0.0;
    config.leave_speed = 0.0;
    result.modes[m] = robot.run(scene, seed, config);
    tell(seed, m, result);
  }
  return result;
}

std::string closed_loop_table(const Robot& robot, const Options& options) {
  std::vector<SceneResult> results(options.count);
  ist::benchmark::for_each(options.count, [&](std::size_t i) {
    results[i] = run_scene(robot, options.first + i, options);
  });
  std::string table = "| avoidance | contacts | driven into:";
  for (const char* kind : kKinds) table += std::string(" ") + kind + ",";
  table.back() = ' ';
  table +=
      "| smallest true distance, median | task done | after, median of these | near starts that "
      "left | contacts there |\n|---|---|---|---|---|---|---|---|\n";
  for (std::size_t m = 0; m < kModeCount; ++m) {
    if (options.asks_for(m)) table += row(m, results);
  }
  return table;
}

// Scenes in which obstacles stop on the arm's way and are hidden from both cameras half of the
// time: collisions by the true shapes.
std::string memory_table(const Robot& robot, const Options& options) {
  constexpr double kStill = 0.02;  // [rad/s] a slower arm is not called moving
  std::string table =
      "| | scenes | collisions | with a moving arm | smallest true distance, median | tasks done | "
      "goals |\n|---|---|---|---|---|---|---|\n";
  for (const bool remembers : {false, true}) {
    ist::sim::ClosedLoopConfig config;
    config.memory.decay = 5.0;
    config.remember = remembers;
    std::vector<ClosedLoopResult> results(options.count);
    ist::benchmark::for_each(options.count, [&](std::size_t i) {
      const SceneRules rules;
      const std::uint64_t seed = options.first + i;
      const Scene scene =
          ist::sim::make_scene(robot.description, seed, rules, [&](const Scene& one) {
            return ist::sim::nominal_motion(robot.description, one, config.controller);
          });
      results[i] = robot.run(ist::sim::hidden_half_of_the_time(scene, rules, {}), seed, config);
    });
    int collisions = 0, moving = 0, done = 0, goals = 0;
    std::vector<double> distance;
    for (const ClosedLoopResult& r : results) {
      collisions += r.smallest_distance <= 0.0 ? 1 : 0;
      moving += r.smallest_distance <= 0.0 && r.speed_at_touch > kStill ? 1 : 0;
      done += r.goals >= Scene().task ? 1 : 0;
      goals += r.goals;
      distance.push_back(1e3 * r.smallest_distance);
    }
    table += text_of("| %s | %zu | %d | %d | %.0f mm | %d | %d |\n",
                     remembers ? "with memory" : "without memory", results.size(), collisions,
                     moving, quantile(distance, 0.5), done, goals);
  }
  return table;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  ist::benchmark::CommandLine line("How safe an arm is that follows the answers.");
  line.add_option("--first", options.first, "Seed of the first scene");
  line.add_option("--count", options.count, "Scenes");
  line.add_option("--hidden-age", options.hidden_age,
                  "How long the filter is told bodies hide [s]");
  line.add_option("--only", options.only, "The one kind of avoidance, as in the table");
  line.add_flag("--memory", options.memory, "Hidden obstacles, without and with memory");
  line.read(argc, argv);
  const Robot robot;
  if (options.memory) return line.publish("hidden obstacles", memory_table(robot, options));
  return line.publish("closed loop", closed_loop_table(robot, options));
}
