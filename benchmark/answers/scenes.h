#pragma once

#include <Eigen/Geometry>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "peers/scene.h"
#include "support/box_oracle.h"
#include "support/npy.h"
#include "support/pcd.h"
#include "support/truth.h"

/// Scenes of the program `answers`: frames of the sensor, a motion, a map.
namespace ist::benchmark {

using Poses = std::vector<Eigen::Isometry3d>;  ///< by link

constexpr std::size_t kMotionPoses = 50;  // taken from the recorded trajectory
constexpr int kStepsPerPose = 10;         // 1 ms apart, about

/// A frame of the sensor as ingest takes it: an organized cloud whose points are read as needed.
/// @param region_radius  [m] of the region of interest about the robot
inline CloudSnapshot ingested(const std::filesystem::path& data, const std::string& name,
                              Span<const PosedSolid> robot, double region_radius) {
  const auto points = std::make_shared<std::vector<Eigen::Vector3f>>(
      test::read_pcd((data / "clouds" / (name + ".pcd")).string()));
  RawCloud raw;
  raw.owner = points;
  raw.data = reinterpret_cast<const std::uint8_t*>(points->data());
  raw.width = 640;
  raw.height = points->size() / raw.width;
  raw.point_step = sizeof(Eigen::Vector3f);
  raw.row_step = raw.width * raw.point_step;
  raw.y = sizeof(float);
  raw.z = 2 * sizeof(float);
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  std::ifstream file(data / "clouds/T_base_cam.txt");
  for (int i = 0; i < 16; ++i) file >> X_FS.matrix()(i / 4, i % 4);
  IngestConfig config;
  config.thin = false;
  Ingest ingest(config);
  ingest.set_region_of_interest({Eigen::Vector3d(0.0, 0.0, 0.3), region_radius});
  CloudSnapshot snapshot;
  ingest.run(raw, X_FS, robot, 0.0, &snapshot);
  return snapshot;
}

/// The recorded trajectory in small steps, so that a bound of one step serves the next ones.
inline std::vector<Poses> small_steps(const std::filesystem::path& data) {
  const test::Npy array = test::read_npy((data / "poses/traj.npy").string());
  std::vector<Poses> poses(kMotionPoses + 1);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    for (std::size_t link = 0; link < test::kPandaLinks; ++link) {
      Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
      const std::size_t first = (k * test::kPandaLinks + link) * 12;
      for (int i = 0; i < 12; ++i) {
        X.matrix()(i / 4, i % 4) = array.values.at(first + static_cast<std::size_t>(i));
      }
      poses[k].push_back(X);
    }
  }
  return interpolated(poses, kStepsPerPose);
}

/// Cubes of 2 to 16 cm about the robot.
inline CloudSnapshot map_of_boxes(const Eigen::Isometry3d& X_FM) {
  test::Rng rng(3);
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < 3000; ++i) boxes.push_back(test::random_leaf(&rng, 1.5, 0.02, 4));
  return test::make_map(boxes, X_FM);
}

}  // namespace ist::benchmark
