#include "internal/cloud/voxel_grid.h"

#include <cmath>

namespace ist {

VoxelGrid::VoxelGrid(const Eigen::Isometry3d& X_FO, double edge_of_voxel) : edge(edge_of_voxel) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) R[3 * i + k] = static_cast<float>(X_FO.linear()(i, k) / edge);
    const double voxels = X_FO.translation()[i] / edge;
    offset[i] = static_cast<float>(voxels - std::floor(voxels));
  }
}

}  // namespace ist
