#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>

#include "ist_proximity/cloud/cloud_layout.h"
#include "ist_proximity/geometry/region_of_interest.h"

namespace ist {

/// No sensor sees farther; what claims to be beyond is out of range whatever the configuration.
/// Keeps coordinates far below kFarAway.
constexpr double kLargestRange = 1e9;  // [m]

/// Which points of a cloud to keep, and where they go: to the frame O of the index.
struct CropPose {
  Eigen::Isometry3d X_FO = Eigen::Isometry3d::Identity();  ///< frame O -> fixed frame
  Eigen::Isometry3d X_OS = Eigen::Isometry3d::Identity();  ///< sensor frame -> O
  double min_range_sq = 0.0, max_range_sq = 0.0;  ///< [m^2] of the points kept, bounds included
  Eigen::Vector3d region_center = Eigen::Vector3d::Zero();            ///< [m] in the sensor frame
  double region_radius_sq = std::numeric_limits<double>::infinity();  ///< [m^2] of the points kept
};

/// O has the fixed frame's axes. Its origin, on whole metres, is the sensor's own position, unless
/// most points are more than a kilometre from it (a cloud that comes in a map's coordinates with a
/// sensor frame to match); then it is their middle. Either way it is subtracted before double
/// becomes float, so that what is within 100 m of the origin is off by less than 0.01 mm.
/// @param cloud      checked by check_layout
/// @param X_FS       sensor frame -> fixed frame, rigid and finite
/// @param min_range, max_range  [m] of the points kept, bounds included
CropPose crop_pose(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, double min_range,
                   double max_range);

/// Only points within a region are kept.
/// @param X_FS  sensor frame -> fixed frame
void limit(const RegionOfInterest& region, const Eigen::Isometry3d& X_FS, CropPose* pose);

/// Gives O other axes.
void turn(const Eigen::Matrix3d& R_FO, CropPose* pose);

}  // namespace ist
