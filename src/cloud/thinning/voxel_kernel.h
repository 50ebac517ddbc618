#pragma once

#include <cstddef>
#include <cstdint>

#include "internal/cloud/point_tile.h"
#include "internal/cloud/voxel_grid.h"

namespace ist {

/// The voxels of a tile's points.
struct alignas(64) TileVoxels {
  float x[kPointWidth], y[kPointWidth], z[kPointWidth];  ///< whole numbers of the voxels
  float offset_sq[kPointWidth];  ///< squared distance to the voxel's centre, in voxels
  /// Slots of the points that are nearest to the centre of their voxel among the tile's points: one
  /// for each voxel, or all that are equally near.
  std::uint8_t nearest[kPointWidth];
};

/// Finds the voxels of a tile's points. @returns how many entries of `nearest` are used
std::size_t find_voxels(const VoxelGrid& grid, const PointTile& tile, TileVoxels* voxels);

}  // namespace ist
