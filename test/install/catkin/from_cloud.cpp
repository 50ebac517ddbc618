// From a cloud of a PCL filter chain to distances: from_cloud robot.urdf
#include <ist_proximity/facade/robot.h>
#include <ist_proximity/pcl.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <cstdio>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const ist::Robot robot(argv[1]);
  const std::vector<double> q(robot.joints().size(), 0.0);

  pcl::PointCloud<pcl::PointXYZ> cloud;  // a wall, in the root link's frame
  for (int i = 0; i < 40; ++i) {
    for (int k = 0; k < 40; ++k) {
      cloud.push_back(
          {0.6F, -0.5F + 0.025F * static_cast<float>(i), 0.025F * static_cast<float>(k)});
    }
  }

  const ist::Obstacles obstacles = ist::to_obstacles(cloud);
  const std::vector<ist::LinkProximity> answers = robot.distances(q, obstacles);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    std::printf("%s: at least %.3f m\n", robot.links()[i].c_str(), answers[i].lower_bound);
  }
  const pcl::PointCloud<pcl::PointXYZ> witnesses = ist::witness_points(answers);
  std::printf("%u pairs of closest points\n", witnesses.width);
  return witnesses.width > 0 ? 0 : 1;
}
