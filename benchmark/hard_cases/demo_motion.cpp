#include "hard_cases/demo_motion.h"

#include "support/demo_arm.h"

namespace ist::benchmark {

DemoMotion::DemoMotion() : robot_(test::demo_robot()), kinematics_(robot_) {
  for (const LinkDescription& link : robot_.links) {
    bodies_.push_back(kinematics_.find_body(link.name).value());
  }
}

Poses DemoMotion::poses(const std::vector<double>& q) const {
  std::vector<double> positions(kinematics_.joints().size(), 0.0);
  std::size_t next = 0;
  for (std::size_t j = 0; j < positions.size() && next < q.size(); ++j) {
    if (kinematics_.joints()[j].is_free()) positions[j] = q[next++];
  }
  JointPoses joints;
  kinematics_.place_joints(positions, &joints);
  BodyPoses all;
  kinematics_.place_bodies(joints, Eigen::Isometry3d::Identity(), &all);
  Poses X_FL;
  for (const std::size_t body : bodies_) X_FL.push_back(all.X_FB[body]);
  return X_FL;
}

Eigen::AlignedBox3d DemoMotion::extent(
    const Poses& X_FL, const std::function<bool(const std::string&)>& is_wanted) const {
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < robot_.links.size(); ++i) {
    if (!is_wanted(robot_.links[i].name)) continue;
    for (const GeometryElement& element : robot_.links[i].geometry) {
      for (const Eigen::Vector3d& v : vertices_of(element.shape)) {
        box.extend(X_FL[i] * element.X_LE * v);
      }
    }
  }
  return box;
}

}  // namespace ist::benchmark
