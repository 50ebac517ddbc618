#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace ist {

/// A grid of cubic voxels along the fixed frame's axes, as seen from a frame O that lies anywhere
/// in it. Float is enough: voxels are no less exact than the coordinates.
struct VoxelGrid {
  VoxelGrid() = default;
  /// @param bounds  [m] in O, of the points that get voxels
  /// @param edge    [m] > 0. It is larger where there would be more than 2^30 voxels from O's
  /// origin
  ///                to a point, whose numbers would not fit.
  VoxelGrid(const Eigen::Isometry3d& X_FO, const Eigen::AlignedBox3f& bounds, double edge);

  double edge = 1.0;    ///< [m]
  double extent = 0.0;  ///< [m] no point is farther from O's origin
  float R[9] = {};      ///< [1/m] rotation from O to the fixed frame over a voxel's edge, row-major
  float offset[3] = {};  ///< O's origin, in voxels
};

}  // namespace ist
