#pragma once

#include <Eigen/Core>

namespace ist {

/// The closest point of triangle abc to p: the projection onto its plane where that is inside
/// (Ericson, Real-Time Collision Detection, 3.4), else the closest point of an edge. Its distance
/// is that of the triangle to a dozen roundings of the coordinates, also for slivers and triangles
/// of zero area. It is found soonest where a is the corner opposite the longest edge.
Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c);

}  // namespace ist
