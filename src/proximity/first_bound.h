#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "internal/bvh/box_node.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Spheres that enclose a link's cover spheres, posed in the frame O of an index, all in float: the
/// children of the tree's root, or finer their children.
struct PosedSpheres {
  /// @param tree  not empty
  PosedSpheres(const InnerSphereTree& tree, const Eigen::Isometry3d& X_OL, bool is_fine);

  static constexpr int kMax = kSphereWidth * kSphereWidth;
  float x[kMax], y[kMax], z[kMax], radius[kMax];  // [m]
  int count = 0;

 private:
  template <class Spheres>
  void add(const Spheres& spheres, const float* radii, int k, const Eigen::Isometry3d& X_OL);
};

/// A lower bound of the distance between some spheres and all obstacles below a box node: the boxes
/// with the least bounds are divided first, for a bounded number of steps. It takes a microsecond
/// or two, five with fine spheres, so that a query can have a bound for each link before it refines
/// any.
/// @param nodes  of the hierarchy
/// @param root   index of the node
/// @param deadline  asked before each division; null: there is none. A search that it stops has a
///                  bound, though a lower one
/// @param late      [s] the search may exceed the deadline by so much
/// @returns [m] rounding is not taken off
float first_bound(const PosedSpheres& spheres, const BoxNode* nodes, std::int32_t root,
                  Deadline* deadline = nullptr, double late = 0.0);

}  // namespace ist
