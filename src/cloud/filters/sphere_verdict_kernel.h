#pragma once

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Spheres prove one of these of some points.
enum class SphereVerdict {
  kClear,      ///< none of them is the robot's
  kOnRobot,    ///< all of them are the robot's
  kUndecided,  ///< the exact geometry has to decide
};

/// Tests the points in a sphere about a centre at once. Descends where a cover sphere may be near
/// enough, into the child that holds the centre deepest first; ends at the first inner sphere that
/// holds all of the points.
/// @param center_L   [m] link frame
/// @param near       [m] a cover sphere nearer to the centre than this leaves it undecided
/// @param held       [m] an inner sphere holds all points when the centre is nearer to it than this
/// @param stop_undecided   also ends, undecided, at the first cover sphere that is near enough
SphereVerdict test_spheres(const InnerSphereTree& tree, const float center_L[3], float near,
                           float held, bool stop_undecided);

}  // namespace ist
