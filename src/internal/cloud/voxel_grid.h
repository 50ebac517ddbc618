#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace ist {

/// [m] Edge of a voxel. The numbers of voxels stay finite in float at any range.
constexpr double kSmallestVoxel = 1e-9;

/// A grid of cubic voxels along the fixed frame's axes, as seen from a frame O that lies anywhere
/// in it. Float is enough: voxels are no less exact than the coordinates.
struct VoxelGrid {
  VoxelGrid() = default;
  /// @param edge  [m] at least kSmallestVoxel
  VoxelGrid(const Eigen::Isometry3d& X_FO, double edge);

  double edge = 1.0;  ///< [m]
  float R[9] = {};    ///< [1/m] rotation from O to the fixed frame over a voxel's edge, row-major
  float offset[3] = {};  ///< O's origin, in voxels
};

}  // namespace ist
