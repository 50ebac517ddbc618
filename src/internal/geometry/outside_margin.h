#pragma once

#include <Eigen/Core>

#include "ist_proximity/geometry/solid.h"

namespace ist {

/// Whether a point is inside a solid, and how far around the point all places are on its side.
///
/// Off the surface of a mesh with holes the winding number w is smooth, and its gradient is an
/// integral along the open edges alone (the law of Biot and Savart, for the solid angle of a
/// surface):
///   |grad w| <= sum over open edges of length / (4 pi distance^2).
/// So while the surface is farther, w stays below 1/2 for some way from a point outside, and longer
/// the farther the holes are. Thread safe; allocates nothing.
struct SideMargin {
  bool is_inside = false;
  /// [m] Every place is on the same side which a way from the point reaches that is shorter than
  /// this and does not cross the surface; 0: unknown.
  double margin = 0.0;
};

/// @param largest  [m] the margin is no larger. With a lower bound of the distance of p_L to the
///                 surface, every place nearer than the margin is on the same side
SideMargin side_margin(const Solid& solid, const Eigen::Vector3d& p_L, double largest);

/// The same, sooner: the margin of a point inside is 0.
SideMargin outside_margin(const Solid& solid, const Eigen::Vector3d& p_L, double largest);

}  // namespace ist
