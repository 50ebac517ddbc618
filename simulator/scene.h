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
  std::vector<Eigen::VectorXd> goals;  ///< joint positions, gone to in turn; it starts at the first
  std::vector<Obstacle> obstacles;     ///< fixed ones first
  std::vector<DepthCameraConfig> cameras;
  int task = 4;            ///< how many goals have to be reached
  double duration = 20.0;  ///< [s] all obstacles have come by then
  double patience = 30.0;  ///< [s] the task is given up then
};

/// The rules that scenes are drawn by: what an arm with such cameras can be asked to dodge.
struct SceneRules {
  int obstacles = 3;          ///< moving ones; one at a time is on its way through the arm
  double first_aim = 3.0;     ///< [s] when the first one meets the undisturbed arm
  double aim_interval = 5.0;  ///< [s] between these instants, +- 0.5 s
  double min_speed = 0.15, max_speed = 0.40;  ///< [m/s]
  double max_slope = 0.5;                     ///< largest vertical share of the direction
  double aim_error = 0.03;       ///< [m] how far from the middle of the link it is aimed at
  double park_distance = 1.3;    ///< [m] from the shoulder, where it comes from and goes to
  double hub_clearance = 0.30;   ///< [m] from the shoulder's axis, near which the arm cannot yield
  double base_clearance = 0.10;  ///< [m] from what cannot move, and from what stands about
  double goal_clearance = 0.28;  ///< [m] from fixed obstacles, on the straight way between goals
};

/// The demo's arm between two goals above its bench, two cameras on opposite sides, and balls and
/// boxes that fly through where the arm would be if nothing disturbed it. All of it follows from
/// the seed. A draw that breaks a rule is drawn anew, before anybody moves.
/// @param robot    the demo arm
/// @param nominal  positions of the undisturbed arm every 10 ms, of a task
Scene make_scene(const RobotDescription& robot, std::uint64_t seed, const SceneRules& rules,
                 const std::function<std::vector<Eigen::VectorXd>(const Scene&)>& nominal);

/// Bench and floor of the demo, which do not move.
std::vector<Obstacle> demo_surroundings();
/// The same, with a ball and a box that cross the demo arm's way again and again.
std::vector<Obstacle> demo_obstacles();
/// Two cameras that look at the demo arm from opposite sides.
std::vector<DepthCameraConfig> demo_cameras();
/// The demo arm's joints that are commanded, and its limits.
ArmConfig demo_arm();

}  // namespace ist::sim
