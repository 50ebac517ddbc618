#pragma once

#include <Eigen/Core>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// [m] radius of the sphere about each thinned point of a cloud.
double point_sphere_radius(const CloudSnapshot& cloud);

/// The share of its own volume that the sphere about a thinned point keeps, beside those about all
/// thinned points of all clouds, its own included: see contact_volume(). Above 0, at most 1.
double kept_share(const Eigen::Vector3d& p_F, double radius, SnapshotSpan clouds);

}  // namespace ist
