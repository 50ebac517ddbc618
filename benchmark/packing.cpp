// The tables of doc/packing.md: time against a yardstick, gaps by number of spheres in the three
// orders, the certificate against the truth, growth, and splits of the tree.
//
// Most of it needs the test data: IST_PROXIMITY_DATA, or ../shared/data.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "internal/geometry/mesh_io.h"
#include "packing/options.h"
#include "support/data_dir.h"
#include "support/truth.h"

namespace ist::benchmark {

std::vector<std::string> panda_names() {
  std::vector<std::string> names;
  for (std::size_t i = 0; i + 1 < test::kPandaLinks; ++i) names.emplace_back(test::panda_mesh(i));
  return names;
}

std::vector<PandaLink> panda_links(const Options& options) {
  std::vector<PandaLink> links;
  if (options.data.empty()) return links;
  const auto folder = options.data / "robots/franka_description/meshes/visual";
  for (const std::string& name : panda_names()) {
    const auto& wanted = options.links;
    if (!wanted.empty() && std::count(wanted.begin(), wanted.end(), name) == 0) continue;
    links.push_back({name, load_mesh((folder / (name + ".dae")).string())});
  }
  return links;
}

namespace {

struct Part {
  const char* name;
  Table (*make)();
  bool (*measure)(const Options&, Table*);
};
constexpr Part kParts[] = {{"time", time_table, measure_time},
                           {"anytime", anytime_table, measure_anytime},
                           {"gaps", gaps_table, measure_gaps},
                           {"certificate", certificate_table, measure_certificate},
                           {"growth", growth_table, measure_growth},
                           {"hierarchy", hierarchy_table, measure_hierarchy}};

constexpr const char* kUsage =
    "usage: packing [OPTION VALUE ...] [--update-doc] [TABLE ...]\n"
    "TABLE: time anytime gaps certificate growth hierarchy; all of them by default\n"
    "  --links NAME,...      of the Panda, for gaps and certificate: link0 ... link7,hand,finger\n"
    "  --spheres N,...         for gaps (200,1000,5000,20000) and growth (50 ... 20000)\n"
    "  --max-errors MM,...   for time and hierarchy (5,2)\n"
    "  --scenes NAME,...     for hierarchy: Panda,demo,synthetic\n"
    "  --instructions        for hierarchy: counts them, by valgrind; takes minutes a scene\n"
    "  --threads N           for what is not timed; 0: as many as there are cores\n"
    "  --cache FOLDER        keeps the packings that hierarchy needs\n"
    "  --update-doc          writes the tables into doc/packing.md; rows that were not measured\n"
    "                        this time stay\n"
    "  --count SCENE         for hierarchy itself, under valgrind\n";

std::vector<std::string> items(const std::string& list) {
  std::vector<std::string> all;
  std::istringstream stream(list);
  for (std::string one; std::getline(stream, one, ',');) all.push_back(one);
  return all;
}

// Returns false if an option is not known.
bool read_arguments(int argc, char** argv, Options* options, std::string* scene) {
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--update-doc") {
      options->update_doc = true;
      continue;
    }
    if (name == "--instructions") {
      options->instructions = true;
      continue;
    }
    const bool is_part = std::any_of(std::begin(kParts), std::end(kParts),
                                     [&](const Part& part) { return name == part.name; });
    if (is_part) {
      options->tables.push_back(name);
      continue;
    }
    if (i + 1 == argc) return false;
    const std::string value = argv[++i];
    if (name == "--links") {
      options->links = items(value);
    } else if (name == "--scenes") {
      options->scenes = items(value);
    } else if (name == "--spheres") {
      for (const std::string& one : items(value)) options->spheres.push_back(std::stoi(one));
    } else if (name == "--max-errors") {
      for (const std::string& one : items(value)) {
        options->max_errors.push_back(1e-3 * std::stod(one));
      }
    } else if (name == "--threads") {
      options->threads = std::stoi(value);
    } else if (name == "--cache") {
      options->cache_directory = value;
    } else if (name == "--count") {
      *scene = value;
    } else {
      return false;
    }
  }
  return true;
}

int run(const Options& options) {
  const std::string folder = std::string(IST_PROXIMITY_SOURCE_DIR) + "/doc/";
  const std::string document = folder + "packing.md";
  int status = 0;
  for (const Part& part : kParts) {
    const auto& wanted = options.tables;
    if (!wanted.empty() && std::count(wanted.begin(), wanted.end(), part.name) == 0) continue;
    Table table = part.make();
    if (!part.measure(options, &table)) {
      std::fprintf(stderr, "%s was not measured. %s\n", part.name,
                   options.data.empty() ? test::kNoData.c_str() : "");
      status = 1;
      continue;
    }
    table.print();
    if (options.update_doc && !table.write(document)) status = 1;
  }
  if (options.update_doc) plot_growth(document, folder + "packing_growth.svg");
  return status;
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  ist::benchmark::Options options;
  std::string scene;
  if (!ist::benchmark::read_arguments(argc, argv, &options, &scene)) {
    std::fputs(ist::benchmark::kUsage, stderr);
    return 2;
  }
  options.program = argv[0];
  options.data = ist::test::data_dir().value_or(std::filesystem::path());
  if (!scene.empty()) {
    ist::benchmark::count_instructions(options, scene);
    return 0;
  }
  return ist::benchmark::run(options);
}
