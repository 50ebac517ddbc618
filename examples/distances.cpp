// Distances of a robot to the points of a file.
//
// Usage: distances robot.urdf scene.pcd        (meshes are found by ROS_PACKAGE_PATH)
#include <cstdio>
#include <exception>
#include <vector>

#include "ist_proximity/facade/robot.h"

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::fprintf(stderr, "Usage: distances robot.urdf scene.pcd\n");
    return 2;
  }
  const ist::Robot robot(argv[1]);
  const auto obstacles = ist::Obstacles::from_file(argv[2]);  // in the root link's frame
  const std::vector<double> q = robot.configuration({});      // all joints at 0

  const std::vector<ist::LinkProximity> answers = robot.distances(q, obstacles);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    std::printf("%-20s at least %.3f m\n", robot.links()[i].c_str(), answers[i].lower_bound);
  }
} catch (const std::exception& error) {  // a file that cannot be read, for example
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
