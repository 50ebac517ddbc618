#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cloud/memory/key_set.h"
#include "cloud/memory/voxel_blocks.h"
#include "cloud/memory/voxel_ray.h"
#include "ist_proximity/cloud/memory_map.h"

namespace ist {

/// The voxels of a MemoryMap, and how clouds change them.
class VoxelMap {
 public:
  /// @throws std::invalid_argument as MemoryMap
  explicit VoxelMap(const MemoryConfig& config);

  void set_region(const RegionOfInterest& region_M);
  void insert(const MemoryScan& scan);
  void clear();
  void clear_free();
  void shift_times(double seconds);

  /// Tells the time; it never goes back.
  void set_now(double time);
  void forget_old();
  /// Sets a voxel to a log-odds value of a time [s], or keeps it where there is no memory.
  void assign(const VoxelKey& key, float log_odds, double time);

  const MemoryConfig& config() const { return config_; }
  const VoxelScale& scale() const { return scale_; }
  const VoxelBlocks& blocks() const { return blocks_; }
  double now() const { return now_; }
  double time(std::uint32_t tick) const;  ///< [s] of a voxel's or block's time
  std::size_t forgotten() const { return forgotten_; }
  std::size_t skipped() const { return skipped_; }
  std::size_t lost() const { return lost_; }
  float least() const { return least_; }
  float most() const { return most_; }

  /// The occupied voxels of a block that the last cloud does not answer for.
  BlockBits hidden(const VoxelBlock& block) const;

 private:
  struct RayEnd {
    Eigen::Vector3f p;  ///< [m]
    bool is_hit;        ///< space is occupied there, and it is in the region
  };

  std::uint32_t tick(double time) const;
  void move_epoch(double epoch);
  bool is_inside(const VoxelKey& key) const;
  VoxelBlock* block_for(const VoxelKey& key);
  void mark(const VoxelKey& key, BlockBits VoxelBlock::*bits);
  void mark_ray(const Eigen::Vector3f& origin, const Eigen::Vector3f& end);
  void mark_shade(const Eigen::Vector3f& origin, const Eigen::Vector3f& end);
  void find_ends(const Eigen::Vector3f& origin, const std::vector<Eigen::Vector3f>& ends);
  void mark_hits();
  void add_rays(const Eigen::Vector3f& origin);
  void update(VoxelBlock* block, unsigned place, float change, std::uint32_t time);
  static void note(VoxelBlock* block, unsigned place, std::uint32_t time, bool is_hit);
  void apply(std::uint32_t time);
  void make_place(std::size_t wanted, bool obstacles);
  void remove_empty_blocks();
  void reset_cursor();
  /// Whether the cloud that is inserted has marked anything in a block.
  bool is_touched(const VoxelBlock& block) const {
    return !touched_.empty() && block.frame == frame_;
  }

  MemoryConfig config_;
  VoxelScale scale_;
  VoxelBlocks blocks_;
  float hit_, miss_, least_, most_;                                      ///< log-odds
  VoxelKey low_{0, 0, 0}, high_{kKeyEnd - 1, kKeyEnd - 1, kKeyEnd - 1};  ///< of the region
  double now_ = std::numeric_limits<double>::quiet_NaN();
  double epoch_ = 0.0;  ///< [s] at which ticks begin
  double first_ = 0.0;  ///< [s] before which nothing was measured
  std::uint32_t frame_ = 1;
  std::size_t forgotten_ = 0, skipped_ = 0, lost_ = 0;
  std::size_t added_ = 0;  ///< blocks that the last cloud added

  // The members below are about the cloud that is inserted.
  std::vector<VoxelBlock*> touched_;  ///< blocks whose bits are of this cloud
  KeySet ends_seen_;
  std::vector<RayEnd> ray_ends_;
  std::uint64_t last_id_ = kNoBlock;
  VoxelBlock* last_block_ = nullptr;
};

}  // namespace ist
