#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "cloud/memory/voxel_ray.h"
#include "ist_proximity/cloud/memory_map.h"

namespace ist {

/// Writes a `.bt` file beside `path`, and renames it then.
/// @param nodes, bytes  as write_octree() makes them
/// @returns an empty string, or one sentence that names the fault
std::string write_memory_file(const std::string& path, double resolution, std::size_t nodes,
                              const std::vector<std::uint8_t>& bytes);

/// Reads a map file whose voxels are those of a memory, and checks that there is memory for all.
/// @param octree  its free leaves, too
/// @returns an empty string, or one sentence that names the fault
std::string read_memory_file(const std::string& path, const MemoryConfig& config, Octree* octree);

/// The keys of a leaf's first voxel, and of the one after its last.
struct KeyBox {
  VoxelKey low, high;
};
KeyBox keys_of(const Eigen::AlignedBox3d& leaf, const VoxelScale& scale);

/// Visits the voxels of a leaf.
template <typename Visit>
void for_each_voxel(const Eigen::AlignedBox3d& leaf, const VoxelScale& scale, const Visit& visit) {
  const KeyBox box = keys_of(leaf, scale);
  for (std::int32_t z = box.low.z; z < box.high.z; ++z) {
    for (std::int32_t y = box.low.y; y < box.high.y; ++y) {
      for (std::int32_t x = box.low.x; x < box.high.x; ++x) visit(VoxelKey{x, y, z});
    }
  }
}

}  // namespace ist
