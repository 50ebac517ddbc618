#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace ist {

/// Coordinates of a voxel, 0 to 65535 each, as octomap's keys: the one that begins at 0 m is 32768.
struct VoxelKey {
  std::int32_t x = 0, y = 0, z = 0;
  bool operator==(const VoxelKey& other) const {
    return x == other.x && y == other.y && z == other.z;
  }
};

constexpr std::int32_t kKeyOrigin = 32768;
constexpr std::int32_t kKeyEnd = 65536;

constexpr int kBlockBits = 3;
constexpr int kBlockSide = 1 << kBlockBits;  ///< voxels along an edge of a block
constexpr std::size_t kBlockVoxels = std::size_t{1} << (3 * kBlockBits);

/// A bit for each voxel of a block: word z, bit 8 y + x.
using BlockBits = std::array<std::uint64_t, kBlockSide>;

/// The number of no block: 39 bits are used.
constexpr std::uint64_t kNoBlock = ~std::uint64_t{0};

/// Number of a block, from the coordinates of a voxel in it: 13 bits an axis.
inline std::uint64_t block_id(const VoxelKey& key) {
  return static_cast<std::uint64_t>(key.x >> kBlockBits) |
         static_cast<std::uint64_t>(key.y >> kBlockBits) << 13U |
         static_cast<std::uint64_t>(key.z >> kBlockBits) << 26U;
}

/// First voxel of a block.
inline VoxelKey first_voxel(std::uint64_t id) {
  constexpr std::uint64_t kMask = 0x1FFF;
  return {static_cast<std::int32_t>((id & kMask) << kBlockBits),
          static_cast<std::int32_t>((id >> 13U & kMask) << kBlockBits),
          static_cast<std::int32_t>((id >> 26U & kMask) << kBlockBits)};
}

/// Place of a voxel in its block: 64 z + 8 y + x.
inline unsigned place_in_block(const VoxelKey& key) {
  constexpr std::int32_t kMask = kBlockSide - 1;
  return static_cast<unsigned>((key.z & kMask) << 6 | (key.y & kMask) << 3 | (key.x & kMask));
}

/// 8 x 8 x 8 voxels.
struct VoxelBlock {
  std::uint64_t id = 0;
  std::uint32_t frame = 0;   ///< the cloud that the bits below `known` are about
  std::uint32_t oldest = 0;  ///< [ticks of VoxelMap] no voxel's time is before
  std::uint32_t newest = 0;  ///< [ticks of VoxelMap] no voxel's time is after
  BlockBits known{}, occupied{};
  BlockBits hit{}, free{}, shaded{};  ///< by one cloud: ends of rays, rays, and just behind ends
  std::array<float, kBlockVoxels> log_odds;      ///< NaN: unknown
  std::array<std::uint32_t, kBlockVoxels> time;  ///< [ticks] of the measurement; undefined: unknown
};

/// The blocks of a map, found by their number in an open-addressing hash table. Blocks keep their
/// address.
class VoxelBlocks {
 public:
  explicit VoxelBlocks(std::size_t max_blocks);

  VoxelBlock* find(std::uint64_t id) const;
  /// The block, made unless it is there; null: there are as many as allowed.
  VoxelBlock* find_or_add(std::uint64_t id);
  /// Removes the blocks for which a predicate holds.
  template <typename Predicate>
  void remove_if(const Predicate& predicate) {
    bool any = false;
    for (std::size_t i = 0; i < blocks_.size();) {
      if (!predicate(*blocks_[i])) {
        ++i;
        continue;
      }
      any = true;
      spare_.push_back(std::move(blocks_[i]));
      blocks_[i] = std::move(blocks_.back());
      blocks_.pop_back();
    }
    if (any) rebuild();
  }
  void clear() {
    remove_if([](const VoxelBlock& /*block*/) { return true; });
  }

  std::size_t size() const { return blocks_.size(); }
  std::size_t max_size() const { return max_blocks_; }
  VoxelBlock& operator[](std::size_t i) { return *blocks_[i]; }
  const VoxelBlock& operator[](std::size_t i) const { return *blocks_[i]; }

 private:
  std::size_t slot_of(std::uint64_t id) const;
  void rebuild();

  std::size_t max_blocks_;
  std::vector<std::unique_ptr<VoxelBlock>> blocks_, spare_;
  std::vector<std::uint32_t> table_;  ///< 0: empty, else the number of a block + 1
};

}  // namespace ist
