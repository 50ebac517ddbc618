#pragma once

#include <Eigen/Core>

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// How deep a point lies in an inner sphere, at most: the largest r - |p - c| [m], negative for a
/// point outside all of them. Depth-first branch and bound.
/// @param floor       [m] the least that is returned; what is less deep is pruned
/// @param sufficient  [m] the search ends when more than this is found
double depth_in_spheres(const InnerSphereTree& tree, const Eigen::Vector3d& p_L, double floor,
                        double sufficient);

/// Whether a sphere [m] intersects an inner sphere of the tree.
inline bool intersects(const InnerSphereTree& tree, const Eigen::Vector3d& center, double radius) {
  return depth_in_spheres(tree, center, -radius, -radius) > -radius;
}

}  // namespace ist
