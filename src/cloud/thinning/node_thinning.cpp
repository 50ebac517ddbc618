#include "cloud/thinning/node_thinning.h"

#include <algorithm>
#include <tuple>

#include "cloud/index/tile_bounds.h"
#include "internal/bvh/traversal_stack.h"

namespace ist {
namespace {

void find_box(ThinnedTile* tile) {
  repeat_last(tile);
  const PaddedBox box = box_of(*tile);
  tile->box = {{box.min[0]}, {box.min[1]}, {box.min[2]}, {box.max[0]}, {box.max[1]}, {box.max[2]}};
}

// Unused slots have no weight.
void find_moments(ThinnedTile* tile) {
  const LaneMap x(tile->x), y(tile->y), z(tile->z), weight(tile->weight);
  PointMoments& moments = tile->moments;
  moments.weight = weight.sum();
  moments.middle[0] = (weight * x).sum() / moments.weight;
  moments.middle[1] = (weight * y).sum() / moments.weight;
  moments.middle[2] = (weight * z).sum() / moments.weight;
  const Lanes dx = x - moments.middle[0], dy = y - moments.middle[1], dz = z - moments.middle[2];
  const Lanes wx = weight * dx, wy = weight * dy, wz = weight * dz;
  moments.spread[0] = (wx * dx).sum();
  moments.spread[1] = (wy * dy).sum();
  moments.spread[2] = (wz * dz).sum();
  moments.spread[3] = (wx * dy).sum();
  moments.spread[4] = (wy * dz).sum();
  moments.spread[5] = (wz * dx).sum();
}

}  // namespace

void NodeThinning::run(std::int32_t node, ThinnedNode* thinned) {
  collect(all_.nodes()[static_cast<std::size_t>(node)]);
  find_rivals(node);
  write(thinned);
}

// The table's entry of a voxel, or the empty one where it belongs. The table is never full.
std::uint16_t* NodeThinning::find(const TileVoxels& voxels, std::size_t slot) {
  for (std::size_t i = voxels.entry[slot];; i = (i + 1) % kVoxelTableSize) {
    const std::uint16_t candidate = table_[i];
    if (candidate == kEmpty || (candidates_.voxel_x[candidate] == voxels.x[slot] &&
                                candidates_.voxel_y[candidate] == voxels.y[slot] &&
                                candidates_.voxel_z[candidate] == voxels.z[slot])) {
      return &table_[i];
    }
  }
}

bool NodeThinning::is_better(const PointTile& tile, const TileVoxels& voxels, std::size_t slot,
                             std::size_t candidate) const {
  const VoxelCandidates& c = candidates_;
  if (voxels.offset_sq[slot] != c.offset_sq[candidate]) {
    return voxels.offset_sq[slot] < c.offset_sq[candidate];
  }
  return std::tie(tile.x[slot], tile.y[slot], tile.z[slot], tile.id[slot]) <
         std::tie(c.x[candidate], c.y[candidate], c.z[candidate], c.id[candidate]);
}

void NodeThinning::set(std::size_t candidate, const PointTile& tile, const TileVoxels& voxels,
                       std::size_t slot) {
  candidates_.voxel_x[candidate] = voxels.x[slot];
  candidates_.voxel_y[candidate] = voxels.y[slot];
  candidates_.voxel_z[candidate] = voxels.z[slot];
  candidates_.offset_sq[candidate] = voxels.offset_sq[slot];
  candidates_.x[candidate] = tile.x[slot];
  candidates_.y[candidate] = tile.y[slot];
  candidates_.z[candidate] = tile.z[slot];
  candidates_.id[candidate] = tile.id[slot];
}

void NodeThinning::collect(const BoxNode& node) {
  table_.fill(kEmpty);
  PointTile scratch;
  for (int i = 0; i < node.count; ++i) {
    add(all_.tile(static_cast<std::size_t>(~node.child[i]), &scratch));
  }
  undefeated_ = candidates_.count;
}

void NodeThinning::add(const PointTile& tile) {
  TileVoxels voxels;
  const std::size_t count = find_voxels(grid_, tile, &voxels);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t slot = voxels.nearest[i];
    std::uint16_t* const entry = find(voxels, slot);
    if (*entry == kEmpty) {
      *entry = static_cast<std::uint16_t>(candidates_.count++);
      set(*entry, tile, voxels, slot);
    } else if (is_better(tile, voxels, slot, *entry)) {
      set(*entry, tile, voxels, slot);
    }
  }
}

// Visits the tiles of other nodes that may hold a rival, the most likely first, until every
// candidate is defeated.
void NodeThinning::find_rivals(std::int32_t own_node) {
  if (candidates_.count == 0) return;
  find_rival_spheres(grid_, &candidates_, &spheres_);
  struct Entry {
    std::int32_t child;
    std::uint32_t node, slot;  // the child's place, where its box is
    float gap;
  };
  TraversalStack<Entry, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack;
  stack.push({all_.root(), 0, 0, 0.0F});
  while (!stack.empty() && undefeated_ > 0) {
    const Entry entry = stack.pop();
    if (entry.child == own_node) continue;
    if (entry.child < 0) {
      challenge(all_.nodes()[entry.node], entry.slot);
      continue;
    }
    const BoxNode& node = all_.nodes()[static_cast<std::size_t>(entry.child)];
    const std::size_t first = stack.size();
    float gaps[kBoxWidth];
    const std::uint32_t near = find_rival_children(node, spheres_, gaps);
    for (std::uint32_t k = 0; near >> k != 0; ++k) {
      if ((near >> k & 1U) == 0) continue;
      stack.push_least_on_top<&Entry::gap>(
          first, {node.child[k], static_cast<std::uint32_t>(entry.child), k, gaps[k]});
    }
  }
}

// A tile is read where spheres of candidates that are not yet defeated meet its box, and the voxels
// of its points are found where one is in such a sphere.
void NodeThinning::challenge(const BoxNode& node, std::size_t child) {
  std::array<std::uint16_t, RivalSpheres::kMost> meeting;
  const std::size_t count = find_meeting_spheres(node, child, spheres_, meeting.data());
  if (count == 0) return;
  PointTile scratch;
  const PointTile& tile = all_.tile(static_cast<std::size_t>(~node.child[child]), &scratch);
  if (is_any_in_spheres(tile, spheres_, meeting.data(), count)) challenge(tile);
}

void NodeThinning::challenge(const PointTile& tile) {
  TileVoxels voxels;
  const std::size_t count = find_voxels(grid_, tile, &voxels);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t slot = voxels.nearest[i];
    const std::uint16_t entry = *find(voxels, slot);
    if (entry == kEmpty || spheres_.radius_sq[entry] < 0.0F) continue;
    if (!is_better(tile, voxels, slot, entry)) continue;
    spheres_.x[entry] = spheres_.y[entry] = spheres_.z[entry] = kFarAway;
    spheres_.radius_sq[entry] = -1.0F;
    --undefeated_;
  }
}

void NodeThinning::write(ThinnedNode* thinned) const {
  thinned->count = 0;
  ThinnedTile* tile = nullptr;
  for (std::size_t i = 0; i < candidates_.count; ++i) {
    if (spheres_.radius_sq[i] < 0.0F) continue;
    if (tile == nullptr || tile->count == kPointWidth) {
      tile = &thinned->tiles[thinned->count++];
      tile->count = 0;
    }
    const int k = tile->count++;
    tile->x[k] = candidates_.x[i];
    tile->y[k] = candidates_.y[i];
    tile->z[k] = candidates_.z[i];
    tile->id[k] = candidates_.id[i];
    tile->weight[k] = cell_weight(candidates_.offset_sq[i]);
  }
  for (std::uint32_t i = 0; i < thinned->count; ++i) {
    ThinnedTile& done = thinned->tiles[i];
    std::fill(done.weight + done.count, done.weight + kPointWidth, 0.0F);
    find_box(&done);  // repeats the last point in unused slots
    find_moments(&done);
    put_unused_far_away(&done);
  }
}

}  // namespace ist
