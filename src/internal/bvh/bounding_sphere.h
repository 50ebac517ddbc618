#pragma once

#include <Eigen/Core>

#include "internal/bvh/box_node.h"

namespace ist {

/// A sphere in the frame of a hierarchy.
struct BoundingSphere {
  Eigen::Vector3d center;
  double radius;  ///< [m]
};

/// The sphere through the corners of a child's box.
inline BoundingSphere bounding_sphere(const BoxNode& node, int k) {
  const Eigen::Vector3d low(node.min_x[k], node.min_y[k], node.min_z[k]);
  const Eigen::Vector3d high(node.max_x[k], node.max_y[k], node.max_z[k]);
  return {0.5 * (low + high), 0.5 * (high - low).norm()};
}

}  // namespace ist
