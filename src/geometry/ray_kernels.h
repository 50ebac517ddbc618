#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "geometry/mesh_ray.h"
#include "internal/geometry/triangle_bvh.h"

/// The SIMD kernels of bundles of rays. The hierarchy must not be empty.
namespace ist {

/// The points origin + t d with d in a box of directions, as inequalities: in each axis,
/// t high >= box.min - origin and t low <= box.max - origin. Each bounds t from one side.
struct Beam {
  struct Bound {
    float reciprocal;  ///< of the direction
    bool is_lower;     ///< whether it bounds t from below
  };
  std::array<float, 3> origin;   ///< [m] from the middle of the mesh
  std::array<Bound, 3> at_high;  ///< of box.min - origin
  std::array<Bound, 3> at_low;   ///< of box.max - origin
  float last;
  float margin;  ///< [m] more than what float rounds off of a coordinate
};

/// The kernel of TriangleBvh::leaves_on_rays.
std::size_t find_leaves(const TriangleBvh::View& bvh, const Beam& beam, TriangleBvh::Boxes* leaves,
                        std::size_t capacity);

/// The kernel of TriangleBvh::first_crossing with leaves.
/// @param o_M    [m] the ray's origin, near the mesh
/// @param first  parameters from here on count
/// @param limit  and up to here
/// @returns the crossing with its parameter from o_M
TriangleBvh::RayCrossing find_crossing(const TriangleBvh::View& bvh,
                                       const TriangleBvh::Boxes* leaves, std::size_t count,
                                       const mesh_ray::FloatRay& ray, const Eigen::Vector3d& o_M,
                                       const Eigen::Vector3d& d_M, double first, double limit);

}  // namespace ist
