#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>

namespace ist {

/// A convex part of a link: a triangle of a mesh or of a box, a solid sphere or a solid cylinder.
struct ConvexPart {
  enum class Kind : std::uint8_t { kTriangle, kSphere, kCylinder };
  Kind kind = Kind::kTriangle;
  /// [m] triangle: its corners; sphere: a is the centre; cylinder: a is the centre and b leads from
  /// there to the centre of a cap, c is not used
  Eigen::Vector3d a, b, c;
  double radius = 0.0;       ///< [m] of a sphere or cylinder
  std::uint32_t number = 0;  ///< for the user of the part
};

/// The same part in another frame. @param X  rigid
ConvexPart posed(const ConvexPart& part, const Eigen::Isometry3d& X);

/// [m] The support function: the largest n.x of its points. @param n  unit
double support(const ConvexPart& part, const Eigen::Vector3d& n);

/// The closest points of two convex parts P and Q, in the frame of both.
struct ConvexDistance {
  /// [m] of the two points; 0 where the parts intersect; negative where the centre of a sphere is
  /// nearer to the other part than its radius
  double distance = std::numeric_limits<double>::infinity();
  /// [m] proven by a separating plane, but for the rounding of coordinates; 0 where none was found
  double lower_bound = 0.0;
  Eigen::Vector3d on_p = Eigen::Vector3d::Zero();
  Eigen::Vector3d on_q = Eigen::Vector3d::Zero();
};

/// The distance of two triangles, also of degenerate ones. The closest points are an edge's and an
/// edge's, or a corner's and a triangle's, unless an edge of one pierces the other. Whatever
/// rounding does to the choice between these, `lower_bound` holds: it is the width of the slab
/// between the two triangles that is perpendicular to the line through the closest points, to a
/// triangle's normal or to two edges, and a slab of any direction separates convex sets.
ConvexDistance triangle_distance(const ConvexPart& p, const ConvexPart& q);

/// The distance of two parts of any kind. Cylinders are measured by GJK (Gilbert, Johnson and
/// Keerthi 1988); spheres are points with a radius.
/// @param enough  [m] the search may end where the distance is proven to be no less than this
ConvexDistance convex_distance(const ConvexPart& p, const ConvexPart& q,
                               double enough = std::numeric_limits<double>::infinity());

/// [m] A lower bound of the distance of a part to a box: the slab between them across the line from
/// the box's centre to the closest point of the part. Its error is that of the rounding of
/// coordinates. 0 where the centre is in the part, or there is no such slab.
/// @param axes  of the box, unit, as columns
/// @param half  [m] half edges along these
double box_bound(const ConvexPart& part, const Eigen::Vector3d& center, const Eigen::Matrix3d& axes,
                 const Eigen::Vector3d& half);

}  // namespace ist
