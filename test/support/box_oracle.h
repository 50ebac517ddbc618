#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/geometry/shapes.h"
#include "support/scene.h"

/// Distances between meshes and solid boxes by brute force, with another algorithm than the
/// library's: an oriented box is twelve triangles, and two triangles are nearest at a corner or at
/// two edges.
namespace ist::test {

/// A box that is axis-aligned in its own frame, and its pose.
struct PlacedBox {
  Eigen::AlignedBox3d box;
  Eigen::Isometry3d X;  ///< its frame -> the mesh's

  Eigen::Vector3d corner(int k) const;
  bool contains(const Eigen::Vector3d& p) const;
};

/// Distance from the mesh's surface to the solid box; 0 if they touch or cross.
double oracle_box_distance(const TriangleMesh& mesh, const PlacedBox& placed);

/// A snapshot of a map of boxes.
CloudSnapshot make_map(const std::vector<Eigen::AlignedBox3d>& boxes_M,
                       const Eigen::Isometry3d& X_FM = Eigen::Isometry3d::Identity());

/// A cube on an octree's grid: its size is the resolution times a power of two.
Eigen::AlignedBox3d random_leaf(Rng* rng, double space, double resolution, int levels);

}  // namespace ist::test
