#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "internal/bvh/box_node.h"

namespace ist {

/// Points of a tile; as many as a node has children.
constexpr int kPointWidth = kBoxWidth;

/// Points, mostly neighbours, side by side for SIMD, in the index's frame O [m]. Unused slots are
/// far away.
struct alignas(64) PointTile {
  float x[kPointWidth], y[kPointWidth], z[kPointWidth];
  std::uint32_t id[kPointWidth];  ///< index of the point in the message it came from
  std::int32_t count;             ///< used slots, at the front

  Eigen::Vector3d point(int k) const { return {x[k], y[k], z[k]}; }
};

}  // namespace ist
