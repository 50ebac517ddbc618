#pragma once

#include <cstddef>
#include <cstdint>

#include "internal/cloud/point_tile.h"
#include "internal/cloud/voxel_grid.h"

namespace ist {

/// Entries of a table of voxels that has twice as many as a node has points.
constexpr std::uint32_t kVoxelTableSize = 2U * kBoxWidth * kPointWidth;

/// The voxels of a tile's points.
struct alignas(64) TileVoxels {
  /// Whole numbers of the voxels along each axis. Numbers beyond the integers are floats that are
  /// whole.
  float x[kPointWidth], y[kPointWidth], z[kPointWidth];
  float offset_sq[kPointWidth];      ///< squared distance to the voxel's centre, in voxels
  std::uint32_t entry[kPointWidth];  ///< of a table of voxels: where a voxel's hash belongs
  /// Slots of the points that are nearest to the centre of their voxel among the tile's points: one
  /// for each voxel, or all that are equally near.
  std::uint8_t nearest[kPointWidth];
};

/// Finds the voxels of a tile's points. @returns how many entries of `nearest` are used
std::size_t find_voxels(const VoxelGrid& grid, const PointTile& tile, TileVoxels* voxels);

}  // namespace ist
