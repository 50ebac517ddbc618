#include "support/random_robots.h"

#include <Eigen/Geometry>
#include <cstddef>
#include <random>
#include <string>

namespace ist::test {

JointDescription joint(const std::string& name, JointType type, const std::string& parent,
                       const std::string& child, const Eigen::Vector3d& p_PJ,
                       const Eigen::Vector3d& axis) {
  JointDescription result;
  result.name = name;
  result.type = type;
  result.parent_link = parent;
  result.child_link = child;
  result.X_PJ.translation() = p_PJ;
  result.axis = axis;
  return result;
}

RobotDescription random_robot(Rng* rng, int max_joints) {
  const auto below = [rng](int n) {
    return std::uniform_int_distribution<std::size_t>(0, static_cast<std::size_t>(n) - 1)(*rng);
  };
  const JointType types[] = {JointType::kFixed, JointType::kRevolute, JointType::kContinuous,
                             JointType::kPrismatic};
  RobotDescription robot;
  robot.root_link = "l0";
  const int count = 1 + static_cast<int>(below(max_joints));
  for (int i = 1; i <= count; ++i) {
    const JointType type = types[below(4)];
    const std::string parent = "l" + std::to_string(below(i));
    JointDescription one = joint("j" + std::to_string(i), type, parent, "l" + std::to_string(i));
    one.X_PJ = random_pose(rng, 1.0);
    one.axis = random_vector(rng, 1.0);
    if (i > 1 && below(3) == 0) {
      const JointDescription& other = robot.joints[below(i - 1)];
      if (other.type != JointType::kFixed) {
        one.mimic = Mimic{other.name, uniform(rng, -1, 1), uniform(rng, -1, 1)};
      }
    }
    robot.joints.push_back(one);
  }
  return robot;
}

}  // namespace ist::test
