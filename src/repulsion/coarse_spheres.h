#pragma once

#include <cstddef>
#include <vector>

#include "ist_proximity/packing/packing.h"

namespace ist {

/// The number of spheres that stand for a link in its repulsion: whole groups.
constexpr std::size_t kCoarseSpheres = 48;

/// Chooses `count` spheres that together extend nearly as far as the packing: the largest first,
/// then always the sphere that protrudes farthest from the chosen ones (farthest-point sampling).
/// Unlike the first spheres of the packing, which may all be of the link's first element, they are
/// spread over the whole link.
std::vector<InnerSphere> coarse_spheres(const Packing& packing, std::size_t count);

constexpr int kSphereGroupWidth = 16;

/// Spheres side by side for SIMD, in metres in the link's frame. Unused slots are far away.
struct alignas(64) SphereGroup {
  float x[kSphereGroupWidth], y[kSphereGroupWidth], z[kSphereGroupWidth], radius[kSphereGroupWidth];
  float bound_center[3], bound_radius;  ///< bounding sphere of all of them
};

/// The same spheres in groups of neighbours.
std::vector<SphereGroup> group_spheres(std::vector<InnerSphere> spheres);

}  // namespace ist
