#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist::benchmark {

/// A robot that moves by at most 1 mm per step (1 m/s at 1 kHz) among standing obstacles.
struct MovingScene {
  std::string name;
  RobotDescription robot;
  CloudSnapshot cloud;
  CloudSnapshot half, twice;  ///< with half and twice as many points on the same obstacles
  std::vector<std::vector<Eigen::Isometry3d>> steps;  ///< by link; link -> fixed frame
  std::vector<bool> begins;  ///< by step: it does not follow from the one before
  /// Steps from here on are compared with exact geometry.
  std::size_t reference_begin = 0, reference_count = 0;
};

/// Scenes of analytic bodies, which are made here.
std::vector<MovingScene> analytic_scenes();

/// The recorded motion among the recorded frames.
std::vector<MovingScene> recorded_scenes(const std::filesystem::path& data);

/// By link, for wrenches: `spheres` at most; from the cache where they are there.
std::vector<std::shared_ptr<const ContactGeometry>> pack_disjoint(
    const RobotDescription& robot, const RobotModel& model, std::size_t spheres,
    const std::string& cache_directory);

/// Packed to `max_error` [m]; from the cache where it is there.
std::shared_ptr<const RobotModel> pack(const RobotDescription& robot, double max_error,
                                       const std::string& cache_directory);

}  // namespace ist::benchmark
