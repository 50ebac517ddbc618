#pragma once

#include <ros/time.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/proximity/world_query.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/poses/transforms.h"

namespace ist {

/// A cloud as queries see it, and the model and frames that it was made with.
struct SourceSnapshot {
  CloudSnapshot cloud;
  ros::Time stamp;
  ros::Time counts_from;  ///< see Measurement::counts_from()
  std::shared_ptr<const RobotModel> model;
  /// By link: false where the self-filter had no pose at the cloud's stamp, so that points on that
  /// link are still among the obstacles. Empty: the source does not filter.
  std::vector<bool> filtered;
  std::uint64_t generation = 0;        ///< see SourceTarget; 0: not filled yet
  std::string fixed_frame, map_frame;  ///< the frames between which the cloud or map is placed
  /// The map's boxes -> `map_frame`.
  Eigen::Isometry3d X_BM = Eigen::Isometry3d::Identity();
  /// Of the frames of a map or of known objects whose poses are late.
  std::vector<Lag> lags;
  /// What the source remembers and the cloud does not show; null: nothing.
  std::shared_ptr<const SourceSnapshot> memory;
  /// A known world, and the surfaces of the model's links; null: a cloud. The boxes of the cloud
  /// belong to the world then.
  PosedWorld world;
  std::shared_ptr<const RobotSurfaces> surfaces;
};

}  // namespace ist
