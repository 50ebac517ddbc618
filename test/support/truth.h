#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/robot/robot_model.h"

/// The Franka Panda among real Kinect frames, with exact distances computed in double precision.
namespace ist::test {

constexpr std::size_t kPandaLinks = 11;
constexpr std::size_t kTruthPoses = 100;

struct TruthRecord {
  double distance;  ///< [m] unsigned, surface to cloud
  std::int32_t points_inside;
};

struct TruthCase {
  std::vector<Eigen::Isometry3d> X_FL;  ///< by link
  TruthRecord links[kPandaLinks];
};

const char* panda_mesh(std::size_t link);

/// As its URDF describes it.
RobotDescription read_panda(const std::filesystem::path& data, GeometrySource source);
/// The visual meshes as links, in the frames of the poses.
RobotDescription panda_description(const std::filesystem::path& data);

std::shared_ptr<RobotModel> panda_model(const std::filesystem::path& data, double max_error);

CloudSnapshot truth_cloud(const std::filesystem::path& data, const std::string& name);

/// @param motion  "traj" or "rand"
std::vector<TruthCase> truth_cases(const std::filesystem::path& data, const std::string& cloud,
                                   const std::string& motion);

}  // namespace ist::test
