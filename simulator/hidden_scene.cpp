#include "hidden_scene.h"

#include <algorithm>
#include <cmath>

namespace ist::sim {
namespace {

constexpr double kBoardDepth = 0.3;    // [m] from the camera
constexpr double kBoardAside = 0.9;    // [m] out of view
constexpr double kBoardMoves = 0.1;    // [s] from one place to the other
constexpr double kBoardMargin = 0.05;  // [m] larger than the view

// How far a board is from before the camera, 0 to 1.
double opening(double time, double period) {
  const double phase = std::fmod(time, period), half = 0.5 * period;
  if (phase < half) return std::min(1.0, phase / kBoardMoves);
  return std::max(0.0, 1.0 - (phase - half) / kBoardMoves);
}

Obstacle board(const DepthCameraConfig& camera, double period) {
  const double width = camera.width / camera.focal_length * kBoardDepth + 2.0 * kBoardMargin;
  const double height = camera.height / camera.focal_length * kBoardDepth + 2.0 * kBoardMargin;
  Obstacle board;
  board.name = "board before " + camera.name;
  board.shape = Box{{width, height, 0.02}};
  board.R_FO = camera.X_FC.linear();
  board.path = [X_FC = camera.X_FC, period](double time) -> Eigen::Vector3d {
    return X_FC * Eigen::Vector3d(0.0, -kBoardAside * opening(time, period), kBoardDepth);
  };
  return board;
}

}  // namespace

Scene hidden_half_of_the_time(Scene scene, const SceneRules& rules, const HiddenRules& hidden) {
  int number = 0;
  for (Obstacle& body : scene.obstacles) {
    if (body.is_fixed()) continue;
    const double stop = rules.first_aim + rules.aim_interval * number++;
    body.path = [line = body, stop, dwell = hidden.dwell](double time) -> Eigen::Vector3d {
      const double moved = time < stop ? time : std::max(stop, time - dwell);
      return line.pose(moved).translation();
    };
  }
  scene.duration += hidden.dwell;
  for (const DepthCameraConfig& camera : scene.cameras) {
    scene.obstacles.push_back(board(camera, hidden.period));
  }
  return scene;
}

}  // namespace ist::sim
