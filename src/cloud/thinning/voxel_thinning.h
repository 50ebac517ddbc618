#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/index/point_bvh_builder.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

/// [m] Edge of a voxel. The numbers of voxels stay finite in float at any range.
constexpr double kSmallestVoxel = 1e-9;

/// Keeps one point of each occupied voxel of a grid that is aligned to the fixed frame: the one
/// nearest to the voxel's centre, so that the choice does not depend on the order of the points and
/// changes little as they move. Keeps its memory. Not thread safe.
class VoxelThinning {
 public:
  /// @param all         the points to thin
  /// @param voxel_size  [m] at least kSmallestVoxel, edge of a voxel
  /// @param thinned     overwritten: the same origin and ids, along the fixed frame's axes
  void run(const PointBvh& all, double voxel_size, PointBvhBuilder* builder, PointBvh* thinned);

 private:
  /// Numbers of a voxel along each axis, from the origin, each as an integer of its own.
  struct Voxel {
    std::int32_t x, y, z;
    bool operator==(const Voxel& other) const {
      return x == other.x && y == other.y && z == other.z;
    }
    /// The place in a cube of 8 x 8 x 8 voxels that is repeated all over space.
    std::size_t place() const {
      return static_cast<std::size_t>((x & 7) | (y & 7) << 3 | (z & 7) << 6);
    }
  };

  /// The best point of a voxel so far.
  struct Entry {
    Voxel voxel;
    float offset_sq;  ///< squared distance to the voxel's centre, in voxels
    float x, y, z;    ///< [m] in the frame of the index
    std::uint32_t id;

    bool better_than(const Entry& other) const;
  };

  static std::size_t hash(const Voxel& voxel);
  bool is_beaten(const Voxel& voxel, float offset_sq) const;
  void add(const Entry& entry);
  std::uint32_t* find(const Voxel& voxel);
  void grow();

  std::vector<Entry> entries_;
  std::vector<std::uint32_t> table_;  ///< open addressing: number of an entry plus one, or 0
  /// Numbers of the entries used last, by the voxel's place: neighbouring points share voxels.
  std::array<std::uint32_t, 512> recent_{};
  std::vector<CloudPoint> points_;
};

}  // namespace ist
