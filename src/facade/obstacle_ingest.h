#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/facade/robot.h"

namespace ist {

/// Indexes clouds by the settings of Obstacles. One thread.
class ObstacleIngest {
 public:
  /// @throws std::invalid_argument when a setting is out of its range
  explicit ObstacleIngest(const ObstaclesConfig& config);

  /// @param cloud     points in the frame S of the settings
  /// @param snapshot  overwritten, its buffers reused
  /// @throws std::invalid_argument as Ingest::run()
  void run(const RawCloud& cloud, CloudSnapshot* snapshot);

 private:
  Eigen::Isometry3d X_FS_;
  Ingest ingest_;
  std::shared_ptr<const RobotModel> model_;  ///< of the solids; null: no self-filter
  std::vector<PosedSolid> robot_;
};

/// The part of the settings that Ingest reads.
IngestConfig to_ingest_config(const ObstaclesConfig& config);

}  // namespace ist
