#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

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
std::size_t find_leaves(const TriangleBvh::View& bvh, const Beam& beam,
                        TriangleBvh::RayLeaf* leaves, std::size_t capacity);

/// Sixteen rays from one origin, in float about the middle of the mesh. A line is given by Pluecker
/// coordinates about a reference point near the mesh, where float is exact enough.
struct alignas(64) RayPacket {
  static constexpr std::size_t kRays = 16;
  float direction[3][kRays], reciprocal[3][kRays];
  float moment[3][kRays];          ///< [m] of the line about the reference point: c x direction
  float last[kRays];               ///< parameters up to here count
  std::array<float, 3> origin;     ///< [m]
  std::array<float, 3> reference;  ///< [m]
  float margin;                    ///< [m] more than what float rounds off of a coordinate
  float edge_margin;               ///< [m^2] the same of an edge function
  std::uint32_t rays;              ///< bits of those that are used
};

/// A triangle that a ray may cross.
struct RayCandidate {
  std::uint32_t ray, slot;  ///< of the packet; for TriangleBvh::triangle()
};

/// Leaves whose triangles are looked at together, and their candidates, at most.
constexpr std::size_t kLeavesAhead = 4;
constexpr std::size_t kCandidates = kLeavesAhead * RayPacket::kRays * TriangleBvh::kWidth;

/// Finds the triangles that rays of a packet may cross in the next leaves that are entered at all.
/// @param leaf        in, out: number of the next one of `leaves`
/// @param candidates  receives up to kCandidates
/// @returns how many candidates there are; 0: there are none in all the leaves that were left
std::size_t find_candidates(const TriangleBvh::View& bvh, const TriangleBvh::RayLeaf* leaves,
                            std::size_t count, const RayPacket& packet, std::size_t* leaf,
                            RayCandidate* candidates);

}  // namespace ist
