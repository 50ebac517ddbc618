#include "support/random_robots.h"

#include <Eigen/Geometry>
#include <cstddef>
#include <random>
#include <string>

namespace ist::test {

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
    JointDescription joint;
    joint.name = "j" + std::to_string(i);
    joint.type = types[below(4)];
    joint.parent_link = "l" + std::to_string(below(i));
    joint.child_link = "l" + std::to_string(i);
    joint.X_PJ = random_pose(rng, 1.0);
    joint.axis = random_vector(rng, 1.0);
    if (i > 1 && below(3) == 0) {
      const JointDescription& other = robot.joints[below(i - 1)];
      if (other.type != JointType::kFixed) {
        joint.mimic = Mimic{other.name, uniform(rng, -1, 1), uniform(rng, -1, 1)};
      }
    }
    robot.joints.push_back(joint);
  }
  return robot;
}

}  // namespace ist::test
