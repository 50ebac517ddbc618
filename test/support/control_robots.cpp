#include "support/control_robots.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/demo_arm.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/random_robots.h"

namespace ist::test {

ControlRobot::ControlRobot(std::string robot_name, std::shared_ptr<const RobotModel> robot_model,
                           const RobotDescription& description)
    : name(std::move(robot_name)),
      model(std::move(robot_model)),
      kinematics(std::make_shared<const Kinematics>(description)),
      forward(*model, kinematics) {
  for (std::size_t j = 0; j < kinematics->joints().size(); ++j) {
    if (kinematics->joints()[j].is_free()) joints.push_back(j);
  }
}

Eigen::VectorXd ControlRobot::random_position(Rng* rng) const {
  Eigen::VectorXd q(static_cast<Eigen::Index>(joints.size()));
  for (std::size_t c = 0; c < joints.size(); ++c) {
    const Kinematics::Joint& joint = kinematics->joints()[joints[c]];
    q[static_cast<Eigen::Index>(c)] =
        uniform(rng, std::max(joint.lower, -2.0), std::min(joint.upper, 2.0));
  }
  return q;
}

void ControlRobot::place(const Eigen::VectorXd& q) {
  std::vector<double> positions(kinematics->joints().size(),
                                std::numeric_limits<double>::quiet_NaN());
  for (std::size_t c = 0; c < joints.size(); ++c) {
    positions[joints[c]] = q[static_cast<Eigen::Index>(c)];
  }
  forward.run(positions);
}

Eigen::Vector3d ControlRobot::point_near(Rng* rng, double distance) const {
  const std::size_t link = below(rng, model->links.size());
  const InnerSphereTree& tree = model->links[link].tree;
  const Eigen::Vector3d p_L = tree.center() + random_vector(rng, 2.0 * tree.radius());
  const SignedDistance surface = model->links[link].solid.signed_distance(p_L);
  return poses().X_FL[link] * (surface.witness + distance * surface.normal);
}

double ControlRobot::exact_distance(std::size_t link, const std::vector<Eigen::Vector3d>& points,
                                    double least) const {
  const Eigen::Isometry3d X_LF = poses().X_FL[link].inverse();
  const InnerSphereTree& tree = model->links[link].tree;
  for (const Eigen::Vector3d& p_F : points) {
    const Eigen::Vector3d p_L = X_LF * p_F;
    if ((p_L - tree.center()).norm() - tree.radius() > least) continue;
    least = std::min(least, model->links[link].solid.signed_distance(p_L).distance);
  }
  return least;
}

double ControlRobot::exact_distance(const std::vector<Eigen::Vector3d>& points) const {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t link = 0; link < model->links.size(); ++link) {
    least = exact_distance(link, points, least);
  }
  return least;
}

ControlRobot demo_control_robot() { return {"demo", demo_model(), demo_robot()}; }

ControlRobot mesh_control_robot() {
  RobotDescription description;
  description.root_link = "l0";
  const std::vector<TriangleMesh> shapes = {
      box({0.2, 0.2, 0.1}), icosphere(0.08, 2),       l_shape(0.2, 0.06), box({0.06, 0.08, 0.25}),
      l_shape(0.15, 0.05),  torus(0.06, 0.02, 16, 8), icosphere(0.04, 1)};
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    LinkDescription link;
    link.name = "l" + std::to_string(i);
    link.geometry = one(shapes[i]);
    description.links.push_back(link);
    if (i == 0) continue;
    description.joints.push_back(
        joint("j" + std::to_string(i), JointType::kRevolute, "l" + std::to_string(i - 1), link.name,
              {0.02, 0.05, 0.18},
              i % 2 == 0 ? Eigen::Vector3d(0.0, 1.0, 0.2) : Eigen::Vector3d(0.1, 0.0, 1.0)));
    description.joints.back().lower = -2.5;
    description.joints.back().upper = 2.5;
  }
  RobotModelConfig config;
  config.packing.max_error = 0.01;
  return {"meshes", build_robot_model(description, config), description};
}

}  // namespace ist::test
