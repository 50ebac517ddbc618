#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "arm.h"
#include "depth_camera.h"
#include "obstacle.h"

namespace ist::sim {

/// A task among obstacles.
struct Scene {
  std::vector<Eigen::VectorXd> goals;  ///< joint positions, in turn; the arm starts at the first
  std::vector<Obstacle> obstacles;     ///< fixed ones first
  std::vector<DepthCameraConfig> cameras;
  int task = 4;            ///< number of goals to reach
  double duration = 20.0;  ///< [s] all obstacles have passed by then
  double patience = 30.0;  ///< [s] time limit of the task
};

/// The rules of random scenes: what an arm with such cameras can be expected to dodge.
struct SceneRules {
  int obstacles = 3;          ///< moving obstacles; one at a time crosses the arm
  double first_aim = 3.0;     ///< [s] when the first obstacle meets the undisturbed arm
  double aim_interval = 5.0;  ///< [s] between such meetings, +- 0.5 s
  double min_speed = 0.15, max_speed = 0.40;  ///< [m/s]
  double max_slope = 0.5;                     ///< largest vertical share of the direction
  double aim_error = 0.03;       ///< [m] distance of the path from the middle of the target link
  double park_distance = 1.3;    ///< [m] from the shoulder to the ends of the path
  double hub_clearance = 0.30;   ///< [m] from the shoulder's axis, near which the arm cannot yield
  double base_clearance = 0.10;  ///< [m] from links that cannot move and from fixed obstacles
  double goal_clearance = 0.28;  ///< [m] from fixed obstacles, on the straight path between goals
  int clutter = 0;               ///< bodies that stand beside the path, or in it
  double clutter_aside =
      0.15;  ///< [m] along each axis at most, from the middle of a link on its way
  double clutter_clearance = 0.12;  ///< [m] from the arm at its goals
  int people = 0;                   ///< columns that walk past, one at a time, as bodies do
  double walking_speed = 1.6;       ///< [m/s]
  double near_walk = 0.55, far_walk = 0.80;  ///< [m] from the shoulder's axis to their middle
  /// [m] from link to link, at joint positions. Where it is set, the goals are on either side of a
  /// position at which the arm, folded below its base, touches itself.
  std::function<double(const Eigen::VectorXd&)> own_distance;
};

/// A random scene: the demo arm moves between two goals above its bench, two cameras look from
/// opposite sides, and spheres and boxes fly through the places where the undisturbed arm would be.
/// The seed determines all of it. A sample that breaks a rule is rejected before the run.
/// @param robot    the demo arm
/// @param nominal  positions of the undisturbed arm every 10 ms, for a scene
Scene make_scene(const RobotDescription& robot, std::uint64_t seed, const SceneRules& rules,
                 const std::function<std::vector<Eigen::VectorXd>(const Scene&)>& nominal);

/// The same arm before one goal: it starts with a ball 15 to 45 mm from one of its links, and the
/// straight way to the goal leads away from it, to 80 mm and more.
Scene make_near_start(const RobotDescription& robot, std::uint64_t seed,
                      const std::function<std::vector<Eigen::VectorXd>(const Scene&)>& nominal);

/// Bench and floor of the demo, which are fixed.
std::vector<Obstacle> demo_surroundings();
/// The same, with a sphere and a box that cross the demo arm's path repeatedly.
std::vector<Obstacle> demo_obstacles();
/// Two cameras that look at the demo arm from opposite sides.
std::vector<DepthCameraConfig> demo_cameras();
/// The commanded joints of the demo arm, and their limits.
ArmConfig demo_arm();

}  // namespace ist::sim
