#pragma once

#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {

/// Winding number at p_M; `beta` as in TriangleBvh. The tree must not be empty.
double sum_winding(const TriangleBvh::View& tree, const Eigen::Vector3d& p_M, float beta);

/// Nearest point within max_distance_sq, or any within enough_sq, or not more than `slack` farther
/// than the nearest. The tree must not be empty.
void find_closest(const TriangleBvh::View& tree, const Eigen::Vector3d& p_M, double max_distance_sq,
                  const Eigen::Vector3d& toward_M, double enough_sq, double slack,
                  ClosestPoint* closest);

/// As TriangleBvh::support. The tree must not be empty.
double find_farthest(const TriangleBvh::View& tree, const Eigen::Vector3d& n_M, double slack,
                     double reached);

}  // namespace ist
