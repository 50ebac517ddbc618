#pragma once

#include <Eigen/Core>

#include "internal/proximity/deadline.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// [m] Radius of the sphere about each thinned point of a cloud.
double point_sphere_radius(const CloudSnapshot& cloud);

/// The weight of the sphere about a thinned point, so that overlapping spheres together count once:
/// its volume over the sum of its lenses with the spheres about all thinned points of all clouds,
/// its own included (see contact_volume()). About 1 / n where n spheres overlap; above 0, at most
/// 1. It is 0 where the deadline passed before all lenses were summed.
double overlap_weight(const Eigen::Vector3d& p_F, double radius, SnapshotSpan clouds,
                      Deadline* deadline);

}  // namespace ist
