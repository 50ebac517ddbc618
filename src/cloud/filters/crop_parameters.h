#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/geometry/region_of_interest.h"

namespace ist {

/// The choice of the points of a cloud that are kept, and the frame O of the index that they are
/// moved to.
struct CropParameters {
  Eigen::Isometry3d X_FO = Eigen::Isometry3d::Identity();  ///< frame O -> fixed frame
  Eigen::Isometry3d X_OS = Eigen::Isometry3d::Identity();  ///< sensor frame -> O
  double min_range_sq = 0.0, max_range_sq = 0.0;  ///< [m^2] of the points kept, bounds included
  double believed_sq = std::numeric_limits<double>::max();  ///< [m^2] >= max_range_sq, finite
  Eigen::Vector3d region_center = Eigen::Vector3d::Zero();  ///< [m] in the sensor frame
  /// [m^2] Points outside this sphere are discarded.
  double region_radius_sq = std::numeric_limits<double>::infinity();
};

/// Parameters without a region of interest. O has the fixed frame's axes. Its origin, on whole
/// metres, is the sensor's position, or the middle of the points when most are more than a
/// kilometre from the sensor (a cloud in a map's coordinates, with a sensor frame to match). It is
/// subtracted before double becomes float, so that points within 100 m of the origin are off by
/// less than 0.01 mm.
/// @param cloud      checked by check_layout
/// @param X_FS       sensor frame -> fixed frame, rigid and finite
/// @param config     its ranges are read
CropParameters crop_parameters(const RawCloud& cloud, const Eigen::Isometry3d& X_FS,
                               const IngestConfig& config);

/// Discards points outside a region of interest, too.
/// @param X_FS  sensor frame -> fixed frame
void limit_to_region(const RegionOfInterest& region, const Eigen::Isometry3d& X_FS,
                     CropParameters* crop);

/// Gives the frame O other axes, with the same origin.
/// @param R_FO  the new axes in the fixed frame, as columns
void set_axes(const Eigen::Matrix3d& R_FO, CropParameters* crop);

}  // namespace ist
