#pragma once

#include <Eigen/Core>

#include "internal/bvh/box_hierarchy.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

/// Sixteen numbers side by side; Eigen turns them into SIMD.
using Lanes = Eigen::Array<float, kPointWidth, 1>;
using LaneMap = Eigen::Map<const Lanes>;

/// Unused slots become the last one used: they add nothing to the box.
inline void repeat_last(PointTile* tile) {
  for (int k = tile->count; k < kPointWidth; ++k) {
    tile->x[k] = tile->x[tile->count - 1];
    tile->y[k] = tile->y[tile->count - 1];
    tile->z[k] = tile->z[tile->count - 1];
  }
}

/// Of all slots.
inline PaddedBox box_of(const PointTile& tile) {
  const LaneMap x(tile.x), y(tile.y), z(tile.z);
  return {{x.minCoeff(), y.minCoeff(), z.minCoeff(), 0.0F},
          {x.maxCoeff(), y.maxCoeff(), z.maxCoeff(), 0.0F}};
}

/// Whether two parts are worth a tile each: if their diagonals add up to less than this share of
/// the whole's. Four by four points of a plane, halved, come to 1.6; a leap to 0.3. Measured on
/// depth images and lidar scans, 0.6 to 0.8 is best: fewer cuts leave long tiles, more leave tiles
/// half empty.
constexpr float kCutBelow = 0.7F;
inline bool is_worth_a_cut(const PaddedBox& front, const PaddedBox& back, const PaddedBox& whole) {
  return front.diagonal() + back.diagonal() < kCutBelow * whole.diagonal();
}

/// Whether neighbouring tiles lie side by side. Four by four squares are four times as long as one
/// of them; where they are much longer, there is a leap between them.
/// @param around  [m] diagonal of the box of all
/// @param sum     [m] of their diagonals
inline bool lie_close_together(float around, float sum, std::size_t count) {
  constexpr float kLongest = 6.0F;
  return around * static_cast<float>(count) <= kLongest * sum;
}

}  // namespace ist
