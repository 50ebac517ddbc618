// What padding does the self-filter need? The simulated arm moves in view of its noisy, late camera
// and nothing else is there: whatever the queries find is false. As Markdown.
//
// Usage: self_view [SECONDS]

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "self_view.h"

namespace {

ist::RobotDescription read_robot() {
  const std::string folder = IST_PROXIMITY_SOURCE_DIR;
  std::ifstream file(folder + "/demo/demo_arm.urdf");
  std::stringstream text;
  text << file.rdbuf();
  return ist::parse_urdf(text.str(), ist::GeometrySource::kCollision,
                         [folder](const std::string&) { return folder; });
}

}  // namespace

int main(int argc, char** argv) {
  const double duration = argc > 1 ? std::atof(argv[1]) : 60.0;
  const ist::RobotDescription robot = read_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::printf(
      "| noise | flying pixels | padding | points on the robot | not dropped | false contacts | "
      "smallest false distance |\n|---|---|---|---|---|---|---|\n");
  struct Case {
    double noise, flying;
  };
  for (const Case& c : {Case{0.0, 0.0}, {0.002, 0.0}, {0.005, 0.0}, {0.01, 0.0}, {0.005, 0.3}}) {
    ist::sim::SelfViewConfig config;
    config.duration = duration;
    config.noise = c.noise;
    config.flying_pixels = c.flying;
    config.paddings = {0.01, 0.02, 0.03, 0.04, 0.06};
    for (const ist::sim::SelfViewResult& r : ist::sim::run_self_view(robot, model, config)) {
      std::printf("| %.0f mm | %.0f %% | %.0f mm | %llu | %llu | %d of %d | %.0f mm |\n",
                  1e3 * c.noise, 100.0 * c.flying, 1e3 * r.padding,
                  static_cast<unsigned long long>(r.on_robot + r.phantoms),
                  static_cast<unsigned long long>(r.phantoms), r.contacts, r.answers,
                  1e3 * r.smallest_distance);
    }
    std::fflush(stdout);
  }
  return 0;
}
