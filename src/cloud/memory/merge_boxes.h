#pragma once

#include "cloud/memory/voxel_blocks.h"
#include "cloud/memory/voxel_ray.h"
#include "ist_proximity/cloud/memory_map.h"

namespace ist {

/// Appends boxes that together are exactly some voxels of a block. Equal rows, and then equal
/// rectangles of neighbouring layers, become one box.
/// @param first  first voxel of the block
void append_boxes(const BlockBits& bits, const VoxelKey& first, const VoxelScale& scale,
                  VoxelBoxes* boxes);

}  // namespace ist
