#pragma once

#include <Eigen/Core>

#include "medial_sphere.h"

namespace ist {

/// Climbs from x to a local maximum of the clearance (the distance to the nearest obstacle): the
/// movement of a ProtoSphere prototype (Weller 2013, section 5.2). Each step goes along the
/// steepest ascent away from all obstacles that are about equally near, so the path follows ridges
/// of the clearance (the medial axis) instead of zigzagging across them.
/// @param x  inside and clear of all spheres
/// @returns a sphere that touches no obstacle and is at least as large as the one about x
MedialSphere climb_clearance(const MedialSphereFinder& finder, const Eigen::Vector3d& x);

}  // namespace ist
