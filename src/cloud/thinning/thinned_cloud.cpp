#include "internal/cloud/thinned_cloud.h"

#include <algorithm>

#include "cloud/thinning/node_thinning.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

void ThinnedStorage::reset(std::size_t nodes, std::size_t tiles) {
  if (nodes + 1 > word_capacity_) {
    word_capacity_ = (nodes + 1) + (nodes + 1) / 2;
    words_ = std::make_unique<std::atomic<std::uint64_t>[]>(word_capacity_);
  }
  if (tiles > tiles_.size()) {
    tiles_ = PageVector<ThinnedTile>();  // the old ones are not copied
    tiles_.resize(tiles + tiles / 2);
  }
  nodes_ = nodes;
  for (std::size_t i = 0; i <= nodes; ++i) words_[i].store(0, std::memory_order_relaxed);
}

bool ThinnedStorage::find(std::size_t node, Span<const ThinnedTile>* tiles) const {
  const std::uint64_t word = words_[node].load(std::memory_order_acquire);
  if ((word & kStored) == 0) return false;
  *tiles = Span<const ThinnedTile>(tiles_.data() + (word >> kFirstShift),
                                   word >> kCountShift & kCountMask);
  return true;
}

// A node has no more thinned tiles than tiles and is stored once, so that the tiles suffice.
void ThinnedStorage::store(std::size_t node, const ThinnedNode& thinned) const {
  std::uint64_t expected = 0;
  if (!words_[node].compare_exchange_strong(expected, kClaimed, std::memory_order_relaxed)) return;
  const std::uint64_t first = words_[nodes_].fetch_add(thinned.count, std::memory_order_relaxed);
  std::copy_n(thinned.tiles, thinned.count, tiles_.data() + first);
  words_[node].store(first << kFirstShift | std::uint64_t{thinned.count} << kCountShift | kStored,
                     std::memory_order_release);
}

bool ThinnedCloud::empty() const { return all_.empty() || !all_.is_thinned_; }
const Eigen::Isometry3d& ThinnedCloud::X_FO() const { return all_.X_FO(); }
const std::vector<BoxNode>& ThinnedCloud::nodes() const { return all_.nodes(); }
std::int32_t ThinnedCloud::root() const { return all_.root(); }

bool ThinnedCloud::is_stored(std::int32_t leaf) const {
  Span<const ThinnedTile> tiles;
  return all_.thinned_.find(static_cast<std::size_t>(leaf), &tiles);
}

Span<const ThinnedTile> ThinnedCloud::tiles(std::int32_t leaf, ThinnedNode* buffer) const {
  const auto node = static_cast<std::size_t>(leaf);
  Span<const ThinnedTile> tiles;
  if (all_.thinned_.find(node, &tiles)) return tiles;
  NodeThinning(all_, all_.grid_).run(leaf, buffer);
  all_.thinned_.store(node, *buffer);
  return Span<const ThinnedTile>(buffer->tiles, buffer->count);
}

}  // namespace ist
