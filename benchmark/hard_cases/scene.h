#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"
#include "peers/scene.h"

/// Scenes in which branch and bound has little to prune: ties, near-ties, contact, enclosure.
namespace ist::benchmark {

/// A robot that moves among points.
struct HardScene {
  std::string name;
  std::string link;  ///< what moves
  RobotDescription robot;
  /// The next image: about `points` points with Gaussian noise of standard deviation `noise` [m].
  std::function<Frame(std::size_t points, double noise, std::mt19937_64* rng)> image;
  std::function<Poses(double time)> poses;  ///< X_FL by link, `time` [s] after the start
  bool is_recorded = false;                 ///< images have a size and a noise of their own
};

/// A rigid body, and the demo arm enclosed by a machine tool and resting on a table.
std::vector<HardScene> hard_scenes();

/// The Panda on the recorded motion, among the recorded frames.
std::vector<HardScene> recorded_scenes(const std::filesystem::path& data,
                                       const std::string& cache_directory);

/// A recorded frame, and the sensor's next images of the same still scene.
std::function<Frame(std::size_t, double, std::mt19937_64*)> images_after(const Frame& frame);

/// The demo arm's link poses.
/// @param q  [rad] by free joint in the order of the URDF; joints that q lacks are at zero
Poses demo_poses(const std::vector<double>& q);

}  // namespace ist::benchmark
