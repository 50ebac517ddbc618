#pragma once

#include <Eigen/Core>
#include <string>

#include "ist_proximity/robot/robot_description.h"
#include "support/scene.h"

/// Kinematic trees with joints of all types that have one position.
namespace ist::test {

/// A joint without limits. @param p_PJ  its origin in the parent link  @param axis  in its own
/// frame
JointDescription joint(const std::string& name, JointType type, const std::string& parent,
                       const std::string& child,
                       const Eigen::Vector3d& p_PJ = Eigen::Vector3d::Zero(),
                       const Eigen::Vector3d& axis = Eigen::Vector3d::UnitX());

/// A robot of 1 to `max_joints` joints j1, j2 ... that move links l1, l2 ...: fixed, revolute,
/// continuous and prismatic; some mimic a joint of a lower number. The root link is l0.
RobotDescription random_robot(Rng* rng, int max_joints);

}  // namespace ist::test
