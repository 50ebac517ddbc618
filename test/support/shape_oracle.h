#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/geometry/shapes.h"
#include "support/oracle.h"

/// Exact signed distances of links, without tree and bound: of primitives by their distance
/// functions, of meshes triangle by triangle.
namespace ist::test {

double oracle_signed_distance(const Box& box, const Eigen::Vector3d& p);

double oracle_signed_distance(const Cylinder& cylinder, const Eigen::Vector3d& p);

double oracle_signed_distance(const Sphere& sphere, const Eigen::Vector3d& p);

/// Signed distance of a link to a point in its frame: the smallest of its elements.
double oracle_signed_distance(const LinkGeometry& link, const Eigen::Vector3d& p_L);

/// Smallest signed distance of any point (fixed frame); +inf without points.
double oracle_minimum(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
                      const std::vector<Eigen::Vector3d>& points_F);

/// The points as the index holds them, rounded to float. Queries are exact for these.
std::vector<Eigen::Vector3d> stored_points(const PointIndex& index);

}  // namespace ist::test
