#pragma once

#include <Eigen/Geometry>
#include <algorithm>

namespace ist {

/// Patches whose longest edge is this share of the mesh's diagonal, or less, are not split:
/// rounding would decide.
constexpr double kMinPatchEdge = 1e-7;

/// A triangle of the surface, or a part of one.
struct SurfacePatch {
  Eigen::Vector3d corner[3];  ///< [m]

  double longest_edge() const {
    return std::max({(corner[0] - corner[1]).norm(), (corner[1] - corner[2]).norm(),
                     (corner[2] - corner[0]).norm()});
  }

  double area() const { return 0.5 * (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm(); }

  /// Bisects the longest edge. This becomes one of the two halves, which cover it without overlap;
  /// the other is returned.
  SurfacePatch split_off_half() {
    int longest = 0;
    double length_sq = -1.0;
    for (int k = 0; k < 3; ++k) {
      const double edge_sq = (corner[k] - corner[(k + 1) % 3]).squaredNorm();
      if (edge_sq > length_sq) {
        length_sq = edge_sq;
        longest = k;
      }
    }
    const int a = longest, b = (longest + 1) % 3;
    const Eigen::Vector3d middle = 0.5 * (corner[a] + corner[b]);
    SurfacePatch other = *this;
    corner[a] = middle;
    other.corner[b] = middle;
    return other;
  }
};

}  // namespace ist
