#include "internal/cloud/voxel_grid.h"

#include <algorithm>
#include <cmath>

namespace ist {
namespace {

constexpr double kMostVoxels = 1 << 30;  // from the origin to either side

}  // namespace

VoxelGrid::VoxelGrid(const Eigen::Isometry3d& X_FO, const Eigen::AlignedBox3f& bounds,
                     double edge_asked) {
  if (!bounds.isEmpty()) {
    extent = static_cast<double>(bounds.min().cwiseAbs().cwiseMax(bounds.max().cwiseAbs()).norm());
  }
  edge = std::max(edge_asked, extent / kMostVoxels);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) R[3 * i + k] = static_cast<float>(X_FO.linear()(i, k) / edge);
    const double voxels = X_FO.translation()[i] / edge;
    offset[i] = static_cast<float>(voxels - std::floor(voxels));
  }
}

}  // namespace ist
