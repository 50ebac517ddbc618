#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/scene.h"

/// Robots for tests of rows and filters.
namespace ist::test {

/// A robot, placed.
struct ControlRobot {
  ControlRobot(std::string robot_name, std::shared_ptr<const RobotModel> robot_model,
               const RobotDescription& description);

  /// Positions of the columns' joints, within limits.
  Eigen::VectorXd random_position(Rng* rng) const;
  void place(const Eigen::VectorXd& q);
  const LinkPoses& poses() const { return forward.links(); }

  /// A point `distance` [m] outside a random place of the robot's surface.
  Eigen::Vector3d point_near(Rng* rng, double distance) const;
  /// [m] Exact: the smallest signed distance of the points (fixed frame) to a link, and `least`
  /// where none is smaller.
  double exact_distance(std::size_t link, const std::vector<Eigen::Vector3d>& points,
                        double least = std::numeric_limits<double>::infinity()) const;
  /// [m] The same to the nearest link.
  double exact_distance(const std::vector<Eigen::Vector3d>& points) const;

  std::string name;
  std::shared_ptr<const RobotModel> model;
  std::shared_ptr<const Kinematics> kinematics;
  ForwardKinematics forward;
  std::vector<std::size_t> joints;  ///< by column
};

/// The demo's arm, of primitives.
ControlRobot demo_control_robot();
/// Six turning joints with links that are meshes, concave ones among them.
ControlRobot mesh_control_robot();

}  // namespace ist::test
