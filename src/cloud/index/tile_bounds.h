#pragma once

#include <Eigen/Core>

#include "internal/bvh/padded_box.h"
#include "internal/cloud/point_tile.h"

namespace ist {

/// Sixteen numbers side by side; Eigen turns them into SIMD.
using Lanes = Eigen::Array<float, kPointWidth, 1>;
using LaneMap = Eigen::Map<const Lanes>;

/// Fills unused slots with the last used one, so that they add nothing to the box.
inline void repeat_last(PointTile* tile) {
  for (int k = tile->count; k < kPointWidth; ++k) {
    tile->x[k] = tile->x[tile->count - 1];
    tile->y[k] = tile->y[tile->count - 1];
    tile->z[k] = tile->z[tile->count - 1];
  }
}

/// Moves unused slots far away.
inline void put_unused_far_away(PointTile* tile) {
  for (int k = tile->count; k < kPointWidth; ++k) {
    tile->x[k] = tile->y[k] = tile->z[k] = kFarAway;
    tile->id[k] = 0;
  }
}

/// The box of all slots.
inline PaddedBox box_of(const PointTile& tile) {
  const LaneMap x(tile.x), y(tile.y), z(tile.z);
  return {{x.minCoeff(), y.minCoeff(), z.minCoeff(), 0.0F},
          {x.maxCoeff(), y.maxCoeff(), z.maxCoeff(), 0.0F}};
}

}  // namespace ist
