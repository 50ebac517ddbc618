#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "internal/bvh/box_node.h"
#include "internal/cloud/point_tile.h"
#include "internal/cloud/voxel_grid.h"

namespace ist {

/// Points of a node, one for each voxel, side by side.
struct alignas(64) VoxelCandidates {
  /// Points of a node, at most.
  static constexpr std::size_t kMost = std::size_t{kBoxWidth} * kPointWidth;

  std::array<float, kMost> voxel_x, voxel_y, voxel_z;  ///< as in TileVoxels
  std::array<float, kMost> offset_sq;                  ///< the same
  std::array<float, kMost> x, y, z;                    ///< [m] in O
  std::array<std::uint32_t, kMost> id;
  std::size_t count = 0;
};

/// Spheres that hold the rivals of the candidates of a node, in O [m].
struct RivalSpheres {
  static constexpr std::size_t kMost = VoxelCandidates::kMost;

  /// Filled up to whole vectors of kPointWidth with spheres that are far away.
  alignas(64) std::array<float, kMost> x, y, z, radius_sq;
  std::size_t count = 0;
  float min[3], max[3];  ///< the box of all spheres
};

/// Finds the places that are no farther from the centre of a candidate's voxel than itself, by
/// candidate. Overwrites the numbers of the candidates' unused slots up to whole vectors.
void find_rival_spheres(const VoxelGrid& grid, VoxelCandidates* candidates, RivalSpheres* spheres);

/// Finds the children of a node whose boxes meet a sphere.
/// @param gaps  by child; the least squared distance of its box from a centre, less the squared
///              radius [m^2]. Set for the children found, and not above 0 for them
/// @returns bit k: child k
std::uint32_t find_rival_children(const BoxNode& node, const RivalSpheres& spheres, float* gaps);

/// Numbers of the spheres that meet the box of a node's child.
/// @param numbers  for as many as there are spheres
/// @returns how many there are
std::size_t find_meeting_spheres(const BoxNode& node, std::size_t child,
                                 const RivalSpheres& spheres, std::uint16_t* numbers);

/// Whether a point of a tile is in one of these spheres.
bool is_any_in_spheres(const PointTile& tile, const RivalSpheres& spheres,
                       const std::uint16_t* numbers, std::size_t count);

}  // namespace ist
