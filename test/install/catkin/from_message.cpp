// A sensor_msgs/PointCloud2 is the obstacles of the cloud that it was made of, to the bit, and
// answers go into this package's message: from_message robot.urdf
#include <ist_proximity/ProximityArray.h>
#include <ist_proximity/facade/robot.h>
#include <ist_proximity/pcl.h>
#include <pcl_conversions/pcl_conversions.h>
#include <sensor_msgs/PointCloud2.h>

#include <cstdio>
#include <vector>

namespace {

ist_proximity::ProximityArray to_message(const ist::Robot& robot, const ist::Obstacles& obstacles) {
  ist::QueryConfig exact;
  exact.tolerance = 0.0;
  ist_proximity::ProximityArray result;
  const std::vector<double> q(robot.joints().size(), 0.0);
  for (const ist::LinkProximity& one : robot.distances(q, obstacles, exact)) {
    ist_proximity::LinkProximity link;
    link.link = robot.links()[result.links.size()];
    link.distance = one.distance;
    result.links.push_back(link);
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const ist::Robot robot(argv[1]);
  pcl::PointCloud<pcl::PointXYZI> cloud(40, 30);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float column = static_cast<float>(i % 40), row = static_cast<float>(i / 40);
    cloud[i].getVector3fMap() << 0.6F + 0.01F * row, 0.03F * column - 0.6F, 0.03F * row;
  }
  sensor_msgs::PointCloud2 message;
  pcl::toROSMsg(cloud, message);
  pcl::PCLPointCloud2 blob;
  pcl_conversions::moveToPCL(message, blob);

  const ist_proximity::ProximityArray a = to_message(robot, ist::to_obstacles(cloud)),
                                      b = to_message(robot, ist::to_obstacles(blob));
  const bool are_equal = !a.links.empty() && a.links == b.links;
  std::printf("%zu links, %s distances\n", a.links.size(), are_equal ? "the same" : "different");
  return are_equal ? 0 : 1;
}
