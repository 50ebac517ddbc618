// Usage: first_query robot.urdf
#include <cmath>
#include <exception>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"

int main(int argc, char** argv) try {
  // Once: the robot. Every link is packed; ROS_PACKAGE_PATH is where meshes are looked for.
  std::ifstream file(argc > 1 ? argv[1] : "robot.urdf");
  const std::string urdf(std::istreambuf_iterator<char>(file), {});
  const auto description =
      ist::parse_urdf(urdf, ist::GeometrySource::kCollision, ist::environment_package_finder());
  const auto robot = ist::build_robot_model(description, {});
  const ist::Kinematics kinematics(description);
  // By joint [rad, m]. NaN is not known, or, of a mimic joint, that it follows its joint.
  std::vector<double> q(kinematics.joints().size(), std::nan(""));
  for (std::size_t i = 0; i < q.size(); ++i) {
    if (kinematics.joints()[i].is_free()) q[i] = 0.0;
  }
  const ist::LinkPoses poses = ist::link_poses(*robot, kinematics, q);

  // For each cloud: here a single point, in a sensor frame that is the fixed frame.
  const float xyz[] = {0.5F, 0.0F, 0.5F};  // [m]
  const ist::RawCloud cloud = ist::packed_cloud(xyz, 1, 1);
  ist::Ingest ingest{ist::IngestConfig()};
  ist::CloudSnapshot snapshot;
  ingest.run(cloud, Eigen::Isometry3d::Identity(),  // points on the robot are dropped
             ist::posed_solids(*robot, poses.X_FL, poses.known), 0.0, &snapshot);

  // In the control loop, with one query object per thread: allocates nothing, never throws.
  ist::ProximityQuery query(robot, {});
  std::vector<ist::LinkProximity> results(robot->links.size());
  query.run(poses.X_FL, poses.known, {&snapshot}, &results);
  for (const ist::LinkProximity& link : results) std::cout << link.lower_bound << " m\n";

  ist::RobotProximity nearest;  // the nearest link only: the others as far as needed
  query.run_minimum(poses.X_FL, poses.known, {&snapshot}, &nearest);
  std::cout << "nearest: " << nearest.nearest.lower_bound << " m\n";
} catch (const std::exception& error) {  // a URDF that cannot be read, for example
  std::cerr << error.what() << "\n";
  return 1;
}
