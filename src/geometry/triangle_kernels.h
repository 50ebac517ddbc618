#pragma once

#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {

/// Winding number at p_M; `beta` as in TriangleBvh. The tree must not be empty.
double sum_winding(const TriangleBvh::View& tree, const Eigen::Vector3d& p_M, float beta);

/// Nearest point within max_distance_sq. The tree must not be empty.
void find_closest(const TriangleBvh::View& tree, const Eigen::Vector3d& p_M, double max_distance_sq,
                  const Eigen::Vector3d& toward_M, ClosestPoint* closest);

}  // namespace ist
