#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// The closest pair of points of a shape S and a solid box B that is axis-aligned in frame O.
struct BoxDistance {
  /// [m] distance of the two points; 0: they touch or overlap; inf: no pair is in range
  double distance = std::numeric_limits<double>::infinity();
  double lower_bound = std::numeric_limits<double>::infinity();  ///< [m] proven, <= distance
  Eigen::Vector3d p_OS = Eigen::Vector3d::Zero();                ///< [m] witness point on the shape
  Eigen::Vector3d p_OB = Eigen::Vector3d::Zero();  ///< [m] witness point on or in the box
};

/// The point of the box closest to p.
inline Eigen::Vector3d clamp_to(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p) {
  return p.cwiseMax(box.min()).cwiseMin(box.max());
}

/// Segment ab and a box: exact, from the roots of a piecewise linear derivative.
BoxDistance segment_to_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                           const Eigen::AlignedBox3d& box);

/// Triangle abc and a box: exact, also for triangles of zero area. There are three cases: an edge
/// of the triangle is closest, a corner of the box is closest to the triangle's inside, or the box
/// pierces the triangle.
BoxDistance triangle_to_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c, const Eigen::AlignedBox3d& box);

/// Sphere and a box: exact.
BoxDistance sphere_to_box(const Sphere& sphere, const Eigen::Vector3d& center_O,
                          const Eigen::AlignedBox3d& box);

/// Solid cylinder and a box, by GJK (Gilbert, Johnson, Keerthi 1988) in double: `distance` is that
/// of two points, `lower_bound` follows from the last separating plane and is usually within 1e-9.
/// @param X_OE          cylinder's frame -> O, rigid
/// @param max_distance  [m] the search ends where a separating plane proves that the distance is
///                      more: `lower_bound` is more, too, and `distance` may be too large
BoxDistance cylinder_to_box(const Cylinder& cylinder, const Eigen::Isometry3d& X_OE,
                            const Eigen::AlignedBox3d& box,
                            double max_distance = std::numeric_limits<double>::infinity());

}  // namespace ist
