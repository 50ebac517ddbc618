#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hard_cases/scene.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

/// Motions during which the nearest link keeps a given distance.
namespace ist::benchmark {

/// A robot without the links that stand still, and parts of a motion of it.
struct MovingRobot {
  std::string name;
  RobotDescription robot;
  /// Link poses, 1 ms apart. Any number is a part of the motion; they are spread over it.
  std::function<std::vector<Poses>(std::size_t part)> part;
};

/// The Panda with its visual meshes on the recorded motion; the demo arm, on a motion of all its
/// joints, and stretched out level with the table.
std::vector<MovingRobot> moving_robots(const std::filesystem::path& data);

/// Raises or lowers the robot at each step so that its nearest link is `distance` [m] from the
/// cloud; negative: that deep inside. The result ends where no height does that near the last one.
std::vector<Poses> kept_at(double distance, const std::vector<Poses>& motion,
                           const std::shared_ptr<const RobotModel>& model,
                           const CloudSnapshot& cloud);

}  // namespace ist::benchmark
