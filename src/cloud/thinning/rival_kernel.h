#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "internal/bvh/box_node.h"
#include "internal/cloud/point_tile.h"

namespace ist {

/// Spheres that hold the rivals of the candidates of a node, in O [m].
struct RivalSpheres {
  /// Points of a node, at most.
  static constexpr std::size_t kMost = std::size_t{kBoxWidth} * kPointWidth;

  /// Filled up to whole vectors of kPointWidth with spheres that are far away.
  alignas(64) std::array<float, kMost> x, y, z, radius_sq;
  std::size_t count = 0;
  float min[3], max[3];  ///< the box of all spheres
};

/// Finds the children of a node whose boxes meet a sphere.
/// @param gaps  by child; the least squared distance of its box from a centre, less the squared
///              radius [m^2]. Set for the children found, and not above 0 for them
/// @returns bit k: child k
std::uint32_t find_rival_children(const BoxNode& node, const RivalSpheres& spheres, float* gaps);

}  // namespace ist
