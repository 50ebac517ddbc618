// From a mapper's tree to distances: from_octree robot.urdf
#include <ist_proximity/facade/robot.h>
#include <ist_proximity/octomap.h>
#include <octomap/OcTree.h>

#include <cstdio>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const ist::Robot robot(argv[1]);
  const std::vector<double> q(robot.joints().size(), 0.0);

  octomap::OcTree tree(0.05);  // a wall from x = 0.6 m, in the root link's frame
  for (int i = -10; i < 10; ++i) {
    for (int k = 0; k < 20; ++k) {
      const auto at = [](int cell) { return 0.05F * static_cast<float>(cell) + 0.025F; };
      tree.updateNode(octomap::point3d(0.625F, at(i), at(k)), true);
    }
  }

  const ist::Obstacles obstacles = ist::to_obstacles(tree);
  const std::vector<ist::LinkProximity> answers = robot.distances(q, obstacles);
  bool is_any_near = false;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    std::printf("%s: at least %.3f m\n", robot.links()[i].c_str(), answers[i].lower_bound);
    is_any_near = is_any_near || answers[i].state == ist::LinkState::kNear;
  }
  return is_any_near ? 0 : 1;
}
