// Finds by sampling which pairs of a robot's links never and which always touch, lists them, and
// writes an SRDF that leaves out the latter.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "internal/robot/package_resolver.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/collision_rules.h"
#include "ist_proximity/proximity/self_query.h"

namespace {

struct Options {
  std::string urdf, srdf;
  std::vector<std::string> package_dirs;
  bool visual = false, never = false;
  ist::PairSampling sampling;
};

void declare(CLI::App* app, Options* options) {
  app->add_option("urdf", options->urdf, "the robot's URDF: a file")->required();
  app->add_option("--package-dirs", options->package_dirs,
                  "folders that are packages, or hold them, by the names of their folders");
  app->add_option("--configurations", options->sampling.configurations,
                  "random configurations (default 2000)")
      ->check(CLI::Range(1, 10000000));
  app->add_option("--seed", options->sampling.seed, "of the random configurations (default 1)");
  app->add_option("--srdf", options->srdf, "file to write: an SRDF for robot_description_semantic");
  app->add_flag("--never", options->never,
                "the SRDF also disables pairs that were never in contact, which proves nothing");
  app->add_flag("--visual", options->visual, "visual geometry instead of collision geometry");
}

int run(const Options& options) {
  std::ifstream file(options.urdf);
  std::stringstream text;
  text << file.rdbuf();
  if (!file) throw ist::ModelError("'" + options.urdf + "' cannot be read");
  const auto source =
      options.visual ? ist::GeometrySource::kVisual : ist::GeometrySource::kCollision;
  const ist::RobotDescription description = ist::parse_urdf(
      text.str(), source, ist::file_package_finder(options.urdf, options.package_dirs));
  ist::RobotModelConfig config;
  config.packing.max_error = 0.02;  // [m] only depths are measured by spheres
  const auto model = ist::build_robot_model(description, config);
  const ist::Kinematics kinematics(description);
  const std::string doubts = ist::sampling_doubts(kinematics);
  if (!doubts.empty()) std::cerr << doubts << '\n';
  const std::vector<bool> all(model->links.size(), true);
  const auto pairs = ist::self_collision_pairs(*model, kinematics, all, {});
  const auto sampled = ist::sample_pairs(model, kinematics, pairs, options.sampling);
  for (const ist::SampledPair& found : sampled) {
    const char* word = found.measured == 0 ? "not known"
                       : found.always()    ? "always"
                       : found.never()     ? "never"
                                           : "sometimes";
    std::printf("%-9s %6zu of %zu  %s and %s\n", word, found.contacts, found.measured,
                model->links[found.pair.first].name.c_str(),
                model->links[found.pair.second].name.c_str());
  }
  if (options.srdf.empty()) return 0;
  std::ofstream out(options.srdf);
  out << ist::to_srdf(*model, kinematics, sampled, options.never);
  if (!out.flush()) throw ist::ModelError("'" + options.srdf + "' cannot be written");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Options options;
    CLI::App app("Finds pairs of links that never or always touch");
    declare(&app, &options);
    CLI11_PARSE(app, argc, argv);
    return run(options);
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << '\n';
    return 1;
  }
}
