#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "ist_proximity/proximity/joint_trajectory.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/demo_arm.h"

namespace ist::benchmark {

using Random = std::mt19937_64;

constexpr double kDuration = 5.0;  // [s] of a trajectory

inline double uniform(Random* random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*random);
}

/// The demo's arm of 7 joints.
struct Arm {
  RobotDescription description = test::demo_robot();
  std::shared_ptr<const RobotModel> model = test::demo_model();
  std::shared_ptr<const Kinematics> kinematics = std::make_shared<Kinematics>(description);
  std::vector<bool> moves = links_that_move(*model, *kinematics, kinematics->bodies().front());

  std::size_t random_link(Random* random) const {
    std::vector<std::size_t> links;
    for (std::size_t i = 0; i < moves.size(); ++i) {
      if (moves[i] && model->links[i].usable()) links.push_back(i);
    }
    return links[(*random)() % links.size()];
  }
};

/// Six positions, between which joints move along cubic polynomials.
inline JointTrajectory random_trajectory(const Arm& arm, Random* random) {
  constexpr std::size_t kPoints = 6;
  const auto& joints = arm.kinematics->joints();
  JointTrajectory path;
  path.positions.assign(kPoints, std::vector<double>(joints.size(), std::nan("")));
  path.velocities = path.positions;
  const double step = kDuration / (kPoints - 1);
  for (std::size_t k = 0; k < kPoints; ++k) path.times.push_back(step * static_cast<double>(k));
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].is_free()) continue;
    const double low = std::max(joints[j].lower, -1.5), high = std::min(joints[j].upper, 1.5);
    for (std::size_t k = 0; k < kPoints; ++k) {
      const double before = k == 0 ? uniform(random, low, high) : path.positions[k - 1][j];
      path.positions[k][j] = std::clamp(before + uniform(random, -0.8, 0.8), low, high);
    }
    for (std::size_t k = 0; k < kPoints; ++k) {
      const bool is_end = k == 0 || k + 1 == kPoints;
      path.velocities[k][j] =
          is_end ? 0.0 : (path.positions[k + 1][j] - path.positions[k - 1][j]) / (2.0 * step);
    }
  }
  return path;
}

}  // namespace ist::benchmark
