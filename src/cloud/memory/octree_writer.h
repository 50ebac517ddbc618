#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/memory/voxel_blocks.h"

namespace ist {

/// Writes the voxels of blocks as octomap writes a tree of 16 levels in binary: depth first, two
/// bits a child. Eight equal children are one leaf. liboctomap would have to be given a tree first,
/// voxel by voxel: benchmark/memory.cpp has the times of both.
/// @param nodes  number of nodes of the tree, inner ones and the root too; 0: nothing is known
std::vector<std::uint8_t> write_octree(const VoxelBlocks& blocks, std::size_t* nodes);

}  // namespace ist
