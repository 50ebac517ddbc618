#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "cloud/thinning/rival_kernel.h"
#include "cloud/thinning/voxel_kernel.h"
#include "internal/cloud/point_bvh.h"
#include "internal/cloud/thinned_cloud.h"
#include "internal/cloud/voxel_grid.h"

namespace ist {

/// Finds the points of a node of the lowest level that belong to the thinned cloud: those that are
/// the nearest to the centre of their voxel among all points of the index. Of equally near ones the
/// coordinates decide, and then the ids, so that the answer depends on no order.
///
/// A point's rivals are nearer to the centre of its voxel than itself: they lie in a sphere about
/// that centre. So a traversal with these spheres finds the few tiles of other nodes that decide,
/// and no others are read.
class NodeThinning {
 public:
  NodeThinning(const PointBvh& all, const VoxelGrid& grid) : all_(all), grid_(grid) {}

  /// To be called once for each object.
  /// @param node     of the lowest level
  /// @param thinned  overwritten
  void run(std::int32_t node, ThinnedNode* thinned);

 private:
  static constexpr std::uint16_t kEmpty = 0xFFFF;
  static_assert(VoxelCandidates::kMost < kEmpty && VoxelCandidates::kMost < kVoxelTableSize,
                "a table that is never full holds the numbers of candidates");

  std::uint16_t* find(const TileVoxels& voxels, std::size_t slot);
  bool is_better(const PointTile& tile, const TileVoxels& voxels, std::size_t slot,
                 std::size_t candidate) const;
  void set(std::size_t candidate, const PointTile& tile, const TileVoxels& voxels,
           std::size_t slot);
  void collect(const BoxNode& node);
  void add(const PointTile& tile);
  void find_rivals(std::int32_t own_node);
  void challenge(const BoxNode& node, std::size_t child);
  void challenge(const PointTile& tile);
  void write(ThinnedNode* thinned) const;

  const PointBvh& all_;
  const VoxelGrid& grid_;
  std::array<std::uint16_t, kVoxelTableSize> table_;  // open addressing: number of a candidate
  VoxelCandidates candidates_;
  std::size_t undefeated_ = 0;
  RivalSpheres spheres_;  // by candidate; those of the defeated are far away, of radius_sq -1
};

}  // namespace ist
