#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "internal/bvh/box_node.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// A link's largest bounding spheres, posed in the frame O of an index, all in float.
struct PosedSpheres {
  /// @param tree  not empty
  PosedSpheres(const InnerSphereTree& tree, const Eigen::Isometry3d& X_OL);

  float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth], radius[kSphereWidth];  // [m]
  int count;
};

/// A lower bound of the distance between some spheres and all obstacles below a box node: the boxes
/// with the least bounds are divided first, for a bounded number of steps. It takes about a
/// microsecond, so that a query can have a bound for each link before it refines any.
/// @param nodes  of the hierarchy
/// @param root   index of the node
/// @returns [m] rounding is not taken off
float first_bound(const PosedSpheres& spheres, const BoxNode* nodes, std::int32_t root);

}  // namespace ist
