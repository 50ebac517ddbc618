#include "cloud/memory/voxel_blocks.h"

#include <limits>

namespace ist {
namespace {

constexpr std::size_t kFirstTable = 1024;  // a power of two, as all sizes

}  // namespace

VoxelBlocks::VoxelBlocks(std::size_t max_blocks) : max_blocks_(max_blocks), table_(kFirstTable) {}

/// The slot of a block, or the empty one where it belongs.
std::size_t VoxelBlocks::slot_of(std::uint64_t id) const {
  const std::size_t mask = table_.size() - 1;
  std::size_t slot = (id * 0x9E3779B97F4A7C15U >> 32U) & mask;  // Fibonacci hashing (Knuth)
  while (table_[slot] != 0 && blocks_[table_[slot] - 1]->id != id) slot = (slot + 1) & mask;
  return slot;
}

VoxelBlock* VoxelBlocks::find(std::uint64_t id) const {
  const std::uint32_t number = table_[slot_of(id)];
  return number == 0 ? nullptr : blocks_[number - 1].get();
}

VoxelBlock* VoxelBlocks::find_or_add(std::uint64_t id) {
  std::size_t slot = slot_of(id);
  if (table_[slot] != 0) return blocks_[table_[slot] - 1].get();
  if (blocks_.size() >= max_blocks_) return nullptr;
  if (2 * (blocks_.size() + 1) > table_.size()) {
    table_.resize(2 * table_.size());
    rebuild();
    slot = slot_of(id);
  }
  std::unique_ptr<VoxelBlock> block;
  if (spare_.empty()) {
    block = std::make_unique<VoxelBlock>();
  } else {
    block = std::move(spare_.back());
    spare_.pop_back();
  }
  block->id = id;
  block->frame = 0;
  block->oldest = std::numeric_limits<std::uint32_t>::max();
  block->newest = 0;
  block->known = block->occupied = block->hit = block->free = block->shaded = BlockBits{};
  block->log_odds.fill(std::numeric_limits<float>::quiet_NaN());
  blocks_.push_back(std::move(block));
  table_[slot] = static_cast<std::uint32_t>(blocks_.size());
  return blocks_.back().get();
}

void VoxelBlocks::rebuild() {
  table_.assign(table_.size(), 0);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    table_[slot_of(blocks_[i]->id)] = static_cast<std::uint32_t>(i + 1);
  }
}

}  // namespace ist
