#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "hard_cases/surface.h"
#include "ist_proximity/robot/robot_description.h"
#include "peers/scene.h"

/// Scenes in which branch and bound has little to prune: ties, near-ties, contact, enclosure.
namespace ist::benchmark {

using Poses = std::vector<Eigen::Isometry3d>;

/// A robot that moves among points.
struct HardScene {
  std::string name;
  std::string link;  ///< what moves: a shape, primitive or mesh, or the arm
  RobotDescription robot;
  /// The next image: about `points` points with Gaussian noise of standard deviation `noise` [m].
  std::function<Frame(std::size_t points, double noise, std::mt19937_64* rng)> image;
  std::function<Poses(double time)> poses;  ///< X_FL by link, `time` [s] after the start
  bool is_recorded = false;                 ///< images have a size and a noise of their own
};

/// Unorganized clouds, sampled anew from the surfaces. The sensor frame is the fixed frame.
std::function<Frame(std::size_t, double, std::mt19937_64*)> images_of(std::vector<Patch> surfaces);

/// The vertices of a mesh, or of a fine mesh inscribed in a primitive, in the element's frame [m].
std::vector<Eigen::Vector3d> vertices_of(const Shape& shape);

/// All scenes that a rigid body moves in; each with its primitive, with a fine mesh, or both.
std::vector<HardScene> body_scenes();
/// The demo arm, enclosed by a machine tool, and resting on a table.
std::vector<HardScene> arm_scenes();

}  // namespace ist::benchmark
