#pragma once

#include <Eigen/Core>

namespace ist {

/// The closest point of triangle abc to p (Ericson, Real-Time Collision Detection, 5.1.5), also for
/// slivers and triangles of zero area.
Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c);

}  // namespace ist
