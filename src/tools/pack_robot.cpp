// Packs a robot's links, or one mesh, offline: fills the cache, reports on each link, and writes
// tables and pictures of the packings.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "internal/packing/packing_cache.h"
#include "internal/robot/mesh_size.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/robot/robot_model.h"
#include "pack_robot/containing_spheres.h"
#include "pack_robot/input.h"
#include "pack_robot/output.h"
#include "pack_robot/picture.h"
#include "pack_robot/sphere_files.h"

namespace {

struct Options {
  std::string input, csv, ply, picture, order = "medial";
  std::vector<std::pair<std::string, std::string>> exports;  // format, file
  std::vector<std::string> package_dirs;
  std::vector<double> max_errors = {ist::PackingConfig().max_error};
  bool visual = false, no_cache = false;
  ist::RobotModelConfig model;
};

const std::map<std::string, ist::PackingOrder> kOrders = {
    {"medial", ist::PackingOrder::kMedial},
    {"disjoint", ist::PackingOrder::kDisjoint},
    {"volume", ist::PackingOrder::kVolume}};

void declare(CLI::App* app, Options* options) {
  ist::PackingConfig& packing = options->model.packing;
  app->add_option("input", options->input, "URDF or mesh: a file or package://NAME/PATH")
      ->required();
  app->add_option("--package-dirs", options->package_dirs,
                  "folders that are packages, or hold them, by the names of their folders");
  app->add_option("--max-error", options->max_errors,
                  "[m] largest distance from a link's surface to its spheres; several make a table "
                  "and a panel of the picture each (default 0.005)")
      ->check(CLI::PositiveNumber);
  app->add_option("--max-spheres", packing.max_spheres, "spheres per link (default 20000)")
      ->check(CLI::Range(1, 10000000));
  app->add_option("--order", options->order,
                  "medial: overlapping, fewest for the error (default); disjoint: none overlap; "
                  "volume: disjoint, the largest that fits first")
      ->check(CLI::IsMember(kOrders));
  app->add_option("--links", options->model.links, "only these links of the robot");
  app->add_flag("--visual", options->visual, "visual geometry, not collision");
  app->add_option("--threads", options->model.threads, "0: as many as there are cores (default)")
      ->check(CLI::Range(0, 256));
  app->add_option("--cache", options->model.cache_directory,
                  "where packings are kept (default: where the node keeps them)");
  app->add_flag("--no-cache", options->no_cache, "packs anew and keeps nothing");
  app->add_option("--csv", options->csv, "writes the table to this file");
  app->add_option("--ply", options->ply,
                  "writes all spheres of the last error to this file, links at joint positions 0: "
                  "x y z radius cover_radius link");
  app->add_option("--picture", options->picture, "draws the packings into this PNG file");
  app->add_option(
         "--export", options->exports,
         "FORMAT FILE: writes spheres that contain each link, of the last error, as urdf "
         "(collision geometry), yaml or curobo (robot file), and prints how well they fit; "
         "may be repeated")
      ->check(CLI::IsMember({"urdf", "yaml", "curobo"}).application_index(0));
}

// Writes the spheres of a model in every format that is asked for.
void export_spheres(const ist::tools::Input& input, const ist::RobotModel& model,
                    const ist::PackingConfig& config,
                    const std::vector<std::pair<std::string, std::string>>& exports) {
  ist::tools::LinkSpheres spheres;
  std::vector<ist::tools::SphereFit> fits;
  for (const ist::LinkDescription& link : input.robot.links) {
    for (const ist::LinkModel& packed : model.links) {
      if (packed.name != link.name || !packed.usable()) continue;
      spheres[link.name] = ist::tools::containing_spheres(packed, link.geometry, config);
      fits.push_back(ist::tools::measure_fit(packed, link.geometry, spheres[link.name]));
    }
  }
  ist::tools::print_fits(fits);
  for (const auto& [format, file] : exports) {
    ist::tools::write_file(file, format == "urdf" ? ist::tools::spheres_as_urdf(input, spheres)
                                 : format == "yaml"
                                     ? ist::tools::spheres_as_yaml(spheres)
                                     : ist::tools::spheres_as_curobo(input, spheres));
  }
}

// One line on the terminal that is drawn again and again; nothing if there is no terminal.
class ProgressBar {
 public:
  void update(const ist::ModelProgress& progress) {
    const int percent = static_cast<int>(100.0 * progress.fraction);
    if (isatty(STDERR_FILENO) != 1 || percent == last_) return;
    last_ = percent;
    constexpr int kWidth = 30;
    const auto full = static_cast<std::size_t>(percent * kWidth / 100);
    std::fprintf(stderr, "\r[%s%s] %3d %%  %-40.40s", std::string(full, '#').c_str(),
                 std::string(kWidth - full, '.').c_str(), percent, progress.link.c_str());
  }
  void finish() {
    if (last_ >= 0) std::fprintf(stderr, "\r%80s\r", "");
    last_ = -1;
  }

 private:
  int last_ = -1;
};

// Returns 0 when every link was packed.
int pack(Options options) {
  const ist::tools::Input input = ist::tools::read_input(
      options.input,
      options.visual ? ist::GeometrySource::kVisual : ist::GeometrySource::kCollision,
      options.package_dirs);
  options.model.packing.order = kOrders.at(options.order);
  if (options.no_cache) options.model.cache_directory.clear();
  for (const std::string& warning : ist::doubtful_sizes(input.robot, options.model.links)) {
    std::cerr << "warning: " << warning << '\n';
  }
  int status = 0;
  std::ostringstream csv;
  std::vector<std::shared_ptr<const ist::RobotModel>> models;
  for (const double max_error : options.max_errors) {
    options.model.packing.max_error = max_error;
    ProgressBar bar;
    ist::RobotModelCallbacks callbacks;
    callbacks.progress = [&](const ist::ModelProgress& progress) { bar.update(progress); };
    std::vector<std::string> warnings;
    callbacks.warning = [&](const std::string& warning) { warnings.push_back(warning); };
    const auto model = ist::build_robot_model(input.robot, options.model, callbacks);
    bar.finish();
    for (const std::string& warning : warnings) std::cerr << "warning: " << warning << '\n';
    const std::vector<ist::tools::Row> rows = ist::tools::measure(input, *model);
    std::printf("%s'%s', max_error %g mm\n", models.empty() ? "" : "\n", model->name.c_str(),
                1e3 * max_error);
    ist::tools::print_table(rows);
    ist::tools::append_csv(max_error, rows, &csv);
    for (const ist::LinkModel& link : model->links) {
      if (link.usable()) continue;
      std::cerr << "error: " << link.error << '\n';
      status = 1;
    }
    models.push_back(model);
  }
  if (!options.csv.empty()) ist::tools::write_file(options.csv, csv.str());
  if (!options.ply.empty()) {
    ist::tools::write_file(options.ply, ist::tools::ply(input, *models.back()));
  }
  if (!options.exports.empty())
    export_spheres(input, *models.back(), options.model.packing, options.exports);
  if (!options.picture.empty()) ist::tools::draw(input, models, options.picture);
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app(
        "Packs the links of a robot (URDF) or one mesh with inner spheres, offline, into the cache "
        "that the node reads. Exit code 1: something could not be packed.",
        "pack_robot");
    Options options;
    options.model.cache_directory = ist::default_cache_directory();
    declare(&app, &options);
    CLI11_PARSE(app, argc, argv);
    return pack(options);
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << '\n';
    return 1;
  }
}
