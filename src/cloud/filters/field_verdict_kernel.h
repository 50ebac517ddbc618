#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "internal/cloud/point_tile.h"
#include "internal/geometry/distance_field.h"

namespace ist {

/// A field of distances proves this of a tile's points. Bit k is of the point in slot k.
struct FieldVerdict {
  std::uint32_t on_robot;  ///< no farther from the surface than the padding
  std::uint32_t clear;     ///< outside, and farther from the surface than the padding
};

/// Looks the points of a tile up in the field of a link. A point that has neither bit is undecided.
/// @param field     not empty
/// @param X_LO      frame of the points -> link frame
/// @param padding   [m]
/// @param rounding  [m] of the points' places in the link frame
FieldVerdict test_by_field(const DistanceField& field, const Eigen::Isometry3f& X_LO,
                           const PointTile& tile, float padding, float rounding);

}  // namespace ist
