#pragma once

#include <Eigen/Core>

#include "ist_proximity/geometry/solid.h"

namespace ist {

/// Distances [m] below this have no direction: the difference of two points is all rounding.
constexpr double kTouchDistance = 1e-12;

/// The signed distance of a point to a primitive, in closed form, in the primitive's frame;
/// distance = inf for a mesh.
SignedDistance primitive_distance(const Shape& shape, const Eigen::Vector3d& p);

/// [m] The support of a primitive: the largest n.x of its points, in its frame; -inf for a mesh.
double primitive_support(const Shape& shape, const Eigen::Vector3d& n);

}  // namespace ist
