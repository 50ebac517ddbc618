#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "cloud/memory/voxel_map.h"

namespace ist {

/// The voxels of a map, for the rest of this folder.
const VoxelMap& voxels_of(const MemoryMap& map);

/// Visits the voxels whose centres lie in a sphere.
template <typename Visit>
void for_each_key_in_sphere(const Eigen::Vector3d& center, double radius, const VoxelScale& scale,
                            const Visit& visit) {
  VoxelKey low, high;
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(radius);
  if (!scale.key(Eigen::Vector3d(center - reach), &low)) return;
  if (!scale.key(Eigen::Vector3d(center + reach), &high)) return;
  const double radius_sq = radius * radius;
  for (std::int32_t z = low.z; z <= high.z; ++z) {
    for (std::int32_t y = low.y; y <= high.y; ++y) {
      for (std::int32_t x = low.x; x <= high.x; ++x) {
        const VoxelKey key{x, y, z};
        if ((scale.middle(key) - center).squaredNorm() <= radius_sq) visit(key);
      }
    }
  }
}

}  // namespace ist
