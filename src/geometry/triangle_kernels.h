#pragma once

#include "internal/geometry/triangle_bvh.h"

/// The SIMD kernels of TriangleBvh. The hierarchy must not be empty.
namespace ist {

struct WindingSum {
  double number;    ///< the winding number
  double far_size;  ///< sum of the absolute values of the terms that are expansions
};

/// The winding number at p_M.
/// @param beta  a node's expansion is used where the point is at least beta radii of the node away
WindingSum sum_winding(const TriangleBvh::View& bvh, const Eigen::Vector3d& p_M, float beta);

/// The kernel of TriangleBvh::closest.
void find_closest(const TriangleBvh::View& bvh, const Eigen::Vector3d& p_M, double max_distance_sq,
                  const Eigen::Vector3d& outward_hint_M, double early_out_sq, double tolerance,
                  ClosestPoint* closest);

/// A sphere that restricts a support function to the surface within it, in the mesh's frame [m].
struct SupportSphere {
  Eigen::Vector3d center;
  double radius;
};

/// The kernel of TriangleBvh::support and support_in_sphere.
/// @param sphere  null: the whole surface
double find_support(const TriangleBvh::View& bvh, const Eigen::Vector3d& n_M,
                    const SupportSphere* sphere, double tolerance, double at_least);

}  // namespace ist
