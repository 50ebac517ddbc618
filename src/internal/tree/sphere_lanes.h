#pragma once

#include <Eigen/Core>

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// A number for each child of a node, side by side; Eigen turns them into SIMD, square roots
/// included.
using SphereLanes = Eigen::Array<float, kSphereWidth, 1>;
using SphereLaneMap = Eigen::Map<const SphereLanes, Eigen::Aligned16>;

}  // namespace ist
