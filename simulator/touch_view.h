#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist::sim {

/// A bar touches an arm at random places in view of a camera whose pose is not known exactly.
struct TouchConfig {
  int places = 30;
  double noise = 0.005;           ///< [m] standard deviation of the depth
  double position_error = 0.005;  ///< [m] of the camera's pose
  double angle_error = 0.0175;    ///< [rad] of the camera's pose
  double latency = 0.05;          ///< [s] from an image's stamp to its arrival
  int resolution = 4;             ///< 1: 160 x 120 pixels; 4: 640 x 480
  double hold = 0.4;              ///< [s] for which the bar touches, after the latency
  /// [m] The touching part of the bar must be in view: a perfect camera has a point of the bar that
  /// is no farther from the arm than this.
  double in_view = 0.002;
  std::vector<IngestConfig> filters;  ///< one run each
  std::uint64_t seed = 1;
};

/// Measurements of one filter.
struct TouchResult {
  int answers = 0;      ///< while the bar touched
  int told = 0;         ///< of these, answers that say CONTACT, or at most 5 mm
  int contacts = 0;     ///< of these, answers that say CONTACT
  int places_told = 0;  ///< places with a majority of such answers
  double mean = 0.0;    ///< [m] distance told, in the mean
  int false_answers =
      0;                 ///< answers of CONTACT or at most 5 mm while the bar was 5 cm away or more
  int free_answers = 0;  ///< answers while the bar was 5 cm away or more
  double offset = 0.0;   ///< [m] last ViewReport::offset
  double blind_skin = 0.0;  ///< [m] the largest of the last cloud
};

/// The demo arm moves for three seconds, then stands still at one pose after the other while a bar
/// comes near at 0.2 m/s, touches a link and leaves.
std::vector<TouchResult> run_touch(const RobotDescription& robot,
                                   const std::shared_ptr<const RobotModel>& model,
                                   const TouchConfig& config);

/// The sensor's pose as tf might give it: off by a rotation about a random axis through the sensor
/// and by a random translation.
Eigen::Isometry3d with_error(const Eigen::Isometry3d& X_FS, double position, double angle,
                             std::uint64_t seed);

}  // namespace ist::sim
