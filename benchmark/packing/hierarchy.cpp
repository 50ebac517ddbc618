// Splits of a packing's spheres into a tree, compared by the cost of queries.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <sstream>
#include <string>
#include <utility>

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#define IST_PROXIMITY_CALLGRIND
#endif

#include "ist_proximity/proximity/proximity_query.h"
#include "packing/hierarchy_scene.h"
#include "packing/options.h"
#include "support.h"
#include "support/temp_dir.h"

namespace ist::benchmark {
namespace {

struct Split {
  const char* name;
  TreeConfig config;
};
constexpr Split kSplits[] = {{"median", {TreeSplit::kMedian, 0.0}},
                             {"surface area", {TreeSplit::kSurfaceArea, 0.0}},
                             {"neural gas", {TreeSplit::kNeuralGas, 0.0}},
                             {"neural gas by volume", {TreeSplit::kNeuralGas, 1.0}}};
constexpr const char* kScenes[] = {
    "Panda, motion at 1 kHz",           "Panda, unrelated poses",
    "demo arm, motion at 1 kHz",        "demo arm, unrelated poses",
    "synthetic links, motion at 1 kHz", "synthetic links, unrelated poses"};
constexpr double kMaxErrors[] = {0.005, 0.002};  // [m]
constexpr std::size_t kCounted = 100;            // queries under valgrind

struct Built {
  std::shared_ptr<const RobotModel> model;
  std::size_t nodes = 0, leaves = 0, spheres = 0;
  double us = 0.0;
};

Built with_split(const RobotModel& model, const TreeConfig& config) {
  const auto copy = std::make_shared<RobotModel>(model);
  Built built;
  ThreadTimer timer;
  for (LinkModel& link : copy->links) link.tree = InnerSphereTree(link.packing, config);
  built.us = timer.lap();
  for (const LinkModel& link : copy->links) {
    built.nodes += link.tree.nodes().size();
    built.leaves += link.tree.leaves().size();
    built.spheres += link.tree.sphere_count();
  }
  built.model = copy;
  return built;
}

struct Cost {
  std::vector<double> us;
  double node_pairs = 0.0, leaf_pairs = 0.0, exact = 0.0;
};

// Runs all of them in turn at every pose, so that other load on the machine affects all alike.
std::vector<Cost> measure(const HierarchyScene& scene, const std::vector<Built>& built) {
  std::vector<Cost> costs(built.size());
  std::vector<LinkProximity> results;
  for (std::size_t c = 0; c < scene.clouds.size(); ++c) {
    std::vector<ProximityQuery> queries;
    for (const Built& one : built) queries.emplace_back(one.model, hierarchy_query_config());
    for (std::size_t p = 0; p < scene.poses.size(); ++p) {
      for (std::size_t i = 0; i < built.size(); ++i) {
        const std::size_t s = (i + p) % built.size();
        ThreadTimer timer;
        queries[s].run(scene.poses[p], scene.known[c][p], {&scene.clouds[c]}, &results);
        costs[s].us.push_back(timer.lap());
        const QueryStatistics& statistics = queries[s].statistics();
        costs[s].node_pairs += static_cast<double>(statistics.node_pairs);
        costs[s].leaf_pairs += static_cast<double>(statistics.leaf_pairs);
        costs[s].exact += static_cast<double>(statistics.exact_evaluations);
      }
    }
  }
  return costs;
}

// The instructions of one query, by split; empty without valgrind.
std::vector<double> instructions(const Options& options, const std::string& scene,
                                 double max_error) {
#ifdef IST_PROXIMITY_CALLGRIND
  const test::TempDir folder;
  std::ostringstream command;
  command << "valgrind --tool=callgrind --instr-atstart=no --callgrind-out-file='"
          << folder.file("count") << "' '" << options.program << "' --cache '"
          << options.cache_directory << "' --max-errors " << 1e3 * max_error << " --count '"
          << scene << "' > '" << folder.file("log") << "' 2>&1";
  if (std::system(command.str().c_str()) != 0) return {};
  std::vector<double> counts;
  for (std::size_t i = 1; i <= std::size(kSplits); ++i) {
    std::ifstream file(folder.file("count." + std::to_string(i)));
    for (std::string line; std::getline(file, line);) {
      if (line.rfind("summary:", 0) != 0) continue;
      counts.push_back(std::stod(line.substr(8)) / static_cast<double>(kCounted));
    }
  }
  return counts.size() == std::size(kSplits) ? counts : std::vector<double>();
#else
  (void)options, (void)scene, (void)max_error;
  return {};
#endif
}

void measure_scene(const Options& options, const std::string& name, double max_error,
                   const HierarchyScene& scene, Table* table) {
  std::vector<Built> built;
  for (const Split& split : kSplits) built.push_back(with_split(*scene.model, split.config));
  const std::vector<Cost> costs = measure(scene, built);
  std::vector<double> counts;
  if (options.instructions) counts = instructions(options, name, max_error);
  for (std::size_t i = 0; i < built.size(); ++i) {
    const Cost& cost = costs[i];
    const auto queries = static_cast<double>(cost.us.size());
    table->add(
        {name, text("%g", 1e3 * max_error), kSplits[i].name,
         std::to_string(built[i].nodes) + " / " + std::to_string(built[i].leaves),
         text("%.1f", static_cast<double>(built[i].spheres) / static_cast<double>(built[i].leaves)),
         text("%.0f", 1e-3 * built[i].us), text("%.0f", cost.node_pairs / queries),
         text("%.0f", cost.leaf_pairs / queries), text("%.1f", cost.exact / queries),
         text("%.1f", quantile(cost.us, 0.5)), text("%.1f", mean(cost.us)),
         counts.empty() ? "" : text("%.0f", 1e-3 * counts[i])});
  }
}

std::vector<double> wanted_errors(const Options& options) {
  return options.max_errors.empty()
             ? std::vector<double>(std::begin(kMaxErrors), std::end(kMaxErrors))
             : options.max_errors;
}

}  // namespace

Table hierarchy_table() {
  Table table(
      "hierarchy",
      {"scene", "max_error [mm]", "split", "nodes / leaves", "spheres a leaf", "built [ms]",
       "node pairs", "leaf pairs", "exact", "query, median [us]", "mean [us]", "1000 instructions"},
      3);
  for (const char* scene : kScenes) {
    for (const double max_error : kMaxErrors) {
      for (const Split& split : kSplits) {
        table.place({scene, text("%g", 1e3 * max_error), split.name});
      }
    }
  }
  return table;
}

bool measure_hierarchy(const Options& options, Table* table) {
  for (const std::string name : kScenes) {
    const auto& wanted = options.scenes;
    const auto starts = [&](const std::string& words) { return name.rfind(words, 0) == 0; };
    if (!wanted.empty() && std::none_of(wanted.begin(), wanted.end(), starts)) continue;
    for (const double max_error : wanted_errors(options)) {
      HierarchyScene scene;
      if (make_hierarchy_scene(options, name, max_error, &scene)) {
        measure_scene(options, name, max_error, scene, table);
      } else {
        std::fprintf(stderr, "%s: the test data is not there\n", name.c_str());
      }
    }
  }
  return true;
}

void count_instructions(const Options& options, const std::string& scene_name) {
#ifdef IST_PROXIMITY_CALLGRIND
  HierarchyScene scene;
  if (!make_hierarchy_scene(options, scene_name, options.max_errors.at(0), &scene)) std::exit(1);
  std::vector<LinkProximity> results;
  for (const Split& split : kSplits) {
    const Built built = with_split(*scene.model, split.config);
    ProximityQuery query(built.model, hierarchy_query_config());
    CALLGRIND_START_INSTRUMENTATION;
    CALLGRIND_ZERO_STATS;
    for (std::size_t i = 0; i < kCounted; ++i) {
      const bool motion = scene_name.find("motion") != std::string::npos;
      const std::size_t p = motion ? i : i * (scene.poses.size() - 1) / kCounted;
      query.run(scene.poses[p], scene.known[0][p], {&scene.clouds[0]}, &results);
    }
    CALLGRIND_DUMP_STATS;
    CALLGRIND_STOP_INSTRUMENTATION;
  }
#else
  (void)options, (void)scene_name;
#endif
}

}  // namespace ist::benchmark
