#pragma once

#include <Eigen/Core>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

/// Brute force in double precision, over every triangle and every point, without tree and bound.
/// All accelerated algorithms are tested against it.
namespace ist::test {

/// Of triangle abc, seen from the origin (van Oosterom and Strackee 1983).
double oracle_solid_angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                          const Eigen::Vector3d& c);
double oracle_winding(const TriangleMesh& mesh, const Eigen::Vector3d& p);

/// Distance from p to triangle abc: to its plane if p projects inside, else to its nearest edge.
/// The library uses another algorithm.
double oracle_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c);

double oracle_distance(const TriangleMesh& mesh, const Eigen::Vector3d& p);

/// Signed distance, negative inside (winding number above 0.5, within the box about the mesh).
double oracle_signed_distance(const TriangleMesh& mesh, const Eigen::Vector3d& p);

/// Smallest signed distance of any point (link frame) to the mesh; +inf without points. Points that
/// cannot be it, by the box about the mesh or by a deeper one, are not measured.
double oracle_minimum(const TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& points);

}  // namespace ist::test
