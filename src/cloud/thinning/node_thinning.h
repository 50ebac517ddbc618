#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "cloud/thinning/rival_kernel.h"
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
  static constexpr std::size_t kMost = RivalSpheres::kMost;
  static constexpr std::size_t kTableSize = 2 * kMost;
  static constexpr std::uint16_t kEmpty = 0xFFFF;

  struct Candidate {
    std::int32_t voxel[3];  // numbers along each axis, from the origin, each as an integer
    float number[3];        // the same as they are
    float offset_sq;        // squared distance to the voxel's centre, in voxels
    float x, y, z;          // [m] in O
    std::uint32_t id;

    bool is_better_than(const Candidate& other) const;
  };

  template <typename Visit>
  void for_each_candidate(const PointTile& tile, const Visit& visit) const;
  std::uint16_t* find(const Candidate& candidate);
  void collect(const BoxNode& node);
  void add(const Candidate& candidate);
  void find_rivals(std::int32_t own_node);
  void set_spheres();
  void challenge(const Candidate& rival);
  void write(ThinnedNode* thinned) const;

  const PointBvh& all_;
  const VoxelGrid& grid_;
  std::array<std::uint16_t, kTableSize> table_;  // open addressing: number of a candidate
  std::array<Candidate, kMost> candidates_;
  std::size_t count_ = 0, undefeated_ = 0;
  RivalSpheres spheres_;  // by candidate; those of the defeated are far away, of radius_sq -1
};

}  // namespace ist
