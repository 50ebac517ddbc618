#include "ist_proximity/cloud/memory_map.h"

#include <cmath>
#include <limits>

#include "cloud/memory/block_bits.h"
#include "cloud/memory/memory_file.h"
#include "cloud/memory/merge_boxes.h"
#include "cloud/memory/octree_writer.h"
#include "cloud/memory/voxel_map.h"
#include "cloud/memory/voxel_map_access.h"

namespace ist {

struct MemoryMap::Impl {
  explicit Impl(const MemoryConfig& config) : voxels(config) {}
  VoxelMap voxels;
};

MemoryMap::MemoryMap(const MemoryConfig& config) : impl_(std::make_unique<Impl>(config)) {}
MemoryMap::~MemoryMap() = default;
MemoryMap::MemoryMap(MemoryMap&&) noexcept = default;
MemoryMap& MemoryMap::operator=(MemoryMap&&) noexcept = default;

const VoxelMap& voxels_of(const MemoryMap& map) { return map.impl_->voxels; }

const MemoryConfig& MemoryMap::config() const { return impl_->voxels.config(); }
double MemoryMap::now() const { return impl_->voxels.now(); }

void MemoryMap::set_region(const RegionOfInterest& region_M) { impl_->voxels.set_region(region_M); }

void MemoryMap::insert(const MemoryScan& scan) { impl_->voxels.insert(scan); }

void MemoryMap::forget(double now) {
  impl_->voxels.set_now(now);
  impl_->voxels.forget_old();
}

void MemoryMap::clear() { impl_->voxels.clear(); }
void MemoryMap::clear_free() { impl_->voxels.clear_free(); }
void MemoryMap::shift_times(double seconds) { impl_->voxels.shift_times(seconds); }

float MemoryMap::log_odds(const Eigen::Vector3d& p_M) const {
  VoxelKey key;
  const bool is_inside = impl_->voxels.scale().key(p_M, &key);
  const VoxelBlock* block = is_inside ? impl_->voxels.blocks().find(block_id(key)) : nullptr;
  return block != nullptr ? block->log_odds[place_in_block(key)]
                          : std::numeric_limits<float>::quiet_NaN();
}

VoxelState MemoryMap::state(const Eigen::Vector3d& p_M) const {
  const float value = log_odds(p_M);
  if (std::isnan(value)) return VoxelState::kUnknown;
  return value >= 0.0F ? VoxelState::kOccupied : VoxelState::kFree;
}

void MemoryMap::hidden_boxes(VoxelBoxes* boxes) const {
  boxes->clear();
  const VoxelBlocks& blocks = impl_->voxels.blocks();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    append_boxes(impl_->voxels.hidden(blocks[i]), first_voxel(blocks[i].id), impl_->voxels.scale(),
                 boxes);
  }
}

void MemoryMap::occupied_boxes(VoxelBoxes* boxes) const {
  boxes->clear();
  const VoxelBlocks& blocks = impl_->voxels.blocks();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    append_boxes(blocks[i].occupied, first_voxel(blocks[i].id), impl_->voxels.scale(), boxes);
  }
}

void MemoryMap::note_free(Span<const Eigen::Vector4f> spheres, double now) {
  VoxelMap& voxels = impl_->voxels;
  voxels.set_now(now);
  voxels.forget_old();
  for (const Eigen::Vector4f& sphere : spheres) {
    for_each_key_in_sphere(sphere.head<3>().cast<double>(), sphere.w(), voxels.scale(),
                           [&](const VoxelKey& key) { voxels.assign(key, voxels.least(), now); });
  }
}

MemoryCounts MemoryMap::counts() const {
  MemoryCounts counts;
  const VoxelBlocks& blocks = impl_->voxels.blocks();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    counts.known += count_bits(blocks[i].known);
    counts.occupied += count_bits(blocks[i].occupied);
  }
  counts.nodes = blocks.size() * kBlockVoxels;
  counts.forgotten = impl_->voxels.forgotten();
  counts.skipped = impl_->voxels.skipped();
  counts.lost = lost();
  return counts;
}

std::size_t MemoryMap::lost() const { return impl_->voxels.lost(); }

bool MemoryMap::has_obstacles() const {
  const VoxelBlocks& blocks = impl_->voxels.blocks();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i].occupied != BlockBits{}) return true;
  }
  return false;
}

std::vector<std::uint8_t> MemoryMap::octree_bytes(std::size_t* nodes) const {
  std::size_t count = 0;
  std::vector<std::uint8_t> bytes = write_octree(impl_->voxels.blocks(), &count);
  if (nodes != nullptr) *nodes = count;
  return bytes;
}

std::string MemoryMap::write_file(const std::string& path) const {
  std::size_t nodes = 0;
  const std::vector<std::uint8_t> bytes = octree_bytes(&nodes);
  return write_memory_file(path, config().resolution, nodes, bytes);
}

std::string MemoryMap::read_file(const std::string& path, double now) {
  Octree octree;
  std::string fault = read_memory_file(path, config(), &octree);
  if (!fault.empty()) return fault;
  VoxelMap& voxels = impl_->voxels;
  voxels.clear();
  voxels.set_now(now);
  const auto fill = [&](const VoxelBoxes& leaves, float log_odds) {
    for (const Eigen::AlignedBox3d& leaf : leaves) {
      for_each_voxel(leaf, voxels.scale(),
                     [&](const VoxelKey& key) { voxels.assign(key, log_odds, now); });
    }
  };
  fill(octree.free_leaves, voxels.least());
  fill(octree.occupied, voxels.most());
  return {};
}

}  // namespace ist
