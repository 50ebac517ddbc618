#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/geometry/shapes.h"
#include "support/link_pair_oracle.h"
#include "support/scene.h"

namespace ist::test {

/// A box that is axis-aligned in its own frame, and its pose.
struct PlacedBox {
  Eigen::AlignedBox3d box;
  Eigen::Isometry3d X;  ///< its frame -> the mesh's
};

/// Distances between a mesh and solid boxes by brute force: an oriented box is twelve triangles.
class BoxOracle {
 public:
  explicit BoxOracle(const TriangleMesh& mesh);
  /// [m] From the surface to the solid box; 0 if they touch or cross.
  double distance(const PlacedBox& placed) const;

 private:
  std::vector<Corners3<double>> triangles_;
  TriangleGroups surface_;
};

/// A snapshot of a map of boxes.
CloudSnapshot make_map(const std::vector<Eigen::AlignedBox3d>& boxes_M,
                       const Eigen::Isometry3d& X_FM = Eigen::Isometry3d::Identity());

/// A cube on an octree's grid: its size is the resolution times a power of two.
Eigen::AlignedBox3d random_leaf(Rng* rng, double space, double resolution, int levels);
std::vector<Eigen::AlignedBox3d> random_leaves(Rng* rng, int count, double space, double resolution,
                                               int levels);

}  // namespace ist::test
