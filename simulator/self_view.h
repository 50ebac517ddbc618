#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/robot/robot_model.h"
#include "simulation.h"

namespace ist::sim {

/// An arm that moves in view of its camera.
struct SelfViewConfig {
  /// Of the self-filter, but for the padding.
  SelfFilterMode mode = SelfFilterMode::kPadding;
  ViewFilterConfig view;
  double position_error = 0.0;            ///< [m] of the camera's pose
  double angle_error = 0.0;               ///< [rad] of the camera's pose
  int resolution = 1;                     ///< 1: 160 x 120 pixels; 4: 640 x 480
  double duration = 60.0;                 ///< [s]
  double noise = 0.005;                   ///< [m] standard deviation of the depth
  double flying_pixels = 0.0;             ///< see DepthCameraConfig
  double latency = 0.05;                  ///< [s]
  double camera_period = 1.0 / 15.0;      ///< [s]
  int query_period = 10;                  ///< [simulation steps]
  std::vector<double> paddings = {0.03};  ///< [m] of the self-filter, one run each
  /// [m] Distance of a ball that stays near the forearm; 0: there is no ball.
  double ball_distance = 0.0;
  std::uint64_t seed = 1;
};

/// Measurements of one padding.
struct SelfViewResult {
  double padding = 0.0;  ///< [m]
  int pictures = 0, answers = 0;
  std::uint64_t on_robot = 0;      ///< points that the self-filter dropped
  std::uint64_t phantoms = 0;      ///< points of the robot that passed the self-filter
  int contacts = 0;                ///< answers in which a link is in CONTACT
  double smallest_distance = 0.0;  ///< [m] of any answer; inf: every link was always CLEAR
  /// Answers while the ball was truly within 5 cm of the arm, and the largest excess [m] of such an
  /// answer over the distance to the ball at the cloud's stamp. (The camera does not see all of the
  /// side that faces the arm.)
  int near = 0;
  double largest_excess = -1.0;
};

/// [rad] The demo arm's positions in this motion.
Eigen::VectorXd self_view_positions(double t);

/// The demo arm moves without a bench, its joints as fast as 1 rad/s, in view of one camera.
/// Nothing else is there but the ball, so that every other point found is a false one.
std::vector<SelfViewResult> run_self_view(const RobotDescription& robot,
                                          const std::shared_ptr<const RobotModel>& model,
                                          const SelfViewConfig& config);

}  // namespace ist::sim
