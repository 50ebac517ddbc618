#include "ist_proximity/cloud/seen_space.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "cloud/memory/block_bits.h"
#include "cloud/memory/merge_boxes.h"
#include "cloud/memory/voxel_map_access.h"
#include "internal/geometry/numbers.h"

namespace ist {

struct SeenSpace::Impl {
  struct SeenBlock {
    BlockBits known{};
    double newest = -kInfinity;  // [s]
  };

  VoxelScale scale{1.0};
  bool is_empty = true;  // no memory has been added
  std::unordered_map<std::uint64_t, SeenBlock> blocks;

  const SeenBlock* find(std::uint64_t id) const {
    const auto block = blocks.find(id);
    return block == blocks.end() ? nullptr : &block->second;
  }

  Eigen::AlignedBox3d box(const VoxelKey& first, std::int32_t voxels_along_x) const {
    return {
        Eigen::Vector3d(scale.border(first.x), scale.border(first.y), scale.border(first.z)),
        Eigen::Vector3d(scale.border(first.x + voxels_along_x), scale.border(first.y + kBlockSide),
                        scale.border(first.z + kBlockSide))};
  }

  // The unknown voxels of a row of blocks along x. Blocks of which nothing is known become one box.
  void append_row(VoxelKey first, std::int32_t last_x, const Eigen::Vector3d& center, double radius,
                  VoxelBoxes* boxes) const {
    VoxelKey run = first;
    std::int32_t length = 0;  // voxels of wholly unknown blocks before `first`
    const auto end_run = [&] {
      if (length > 0) boxes->push_back(box(run, length));
      length = 0;
    };
    for (; first.x <= last_x; first.x += kBlockSide) {
      if (box(first, kBlockSide).squaredExteriorDistance(center) > radius * radius) {
        end_run();
        continue;
      }
      const SeenBlock* block = find(block_id(first));
      if (block == nullptr || block->known == BlockBits{}) {
        if (length == 0) run = first;
        length += kBlockSide;
        continue;
      }
      end_run();
      BlockBits unknown{};
      for (int z = 0; z < kBlockSide; ++z) unknown[z] = ~block->known[z];
      append_boxes(unknown, first, scale, boxes);
    }
    end_run();
  }

  // Appends the parts of the cube about a sphere that lie outside of all keys: nothing can be known
  // there.
  void append_outside(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                      VoxelBoxes* boxes) const {
    const double first = scale.border(0), end = scale.border(kKeyEnd);
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::AlignedBox3d below(low, high), above(low, high);
      below.max()[axis] = std::min(high[axis], first);
      above.min()[axis] = std::max(low[axis], end);
      for (const Eigen::AlignedBox3d& box : {below, above}) {
        if (box.min()[axis] < box.max()[axis]) boxes->push_back(box);
      }
    }
  }
};

SeenSpace::SeenSpace() : impl_(std::make_unique<Impl>()) {}
SeenSpace::~SeenSpace() = default;
SeenSpace::SeenSpace(SeenSpace&&) noexcept = default;
SeenSpace& SeenSpace::operator=(SeenSpace&&) noexcept = default;

void SeenSpace::add(const MemoryMap& map) {
  const VoxelMap& voxels = voxels_of(map);
  if (!impl_->is_empty && impl_->scale.resolution() != voxels.scale().resolution()) {
    throw std::invalid_argument(
        "memories of resolutions " + std::to_string(impl_->scale.resolution()) + " and " +
        std::to_string(voxels.scale().resolution()) + " m cannot be joined.");
  }
  impl_->is_empty = false;
  impl_->scale = voxels.scale();
  for (std::size_t i = 0; i < voxels.blocks().size(); ++i) {
    const VoxelBlock& block = voxels.blocks()[i];
    Impl::SeenBlock& seen = impl_->blocks[block.id];
    for (int z = 0; z < kBlockSide; ++z) seen.known[z] |= block.known[z];
    seen.newest = std::max(seen.newest, voxels.time(block.newest));
  }
}

double SeenSpace::time_seen(const Eigen::Vector3d& p_M) const {
  VoxelKey key;
  const Impl::SeenBlock* block = impl_->scale.key(p_M, &key) ? impl_->find(block_id(key)) : nullptr;
  const bool is_known = block != nullptr && test_bit(block->known, place_in_block(key));
  return is_known ? block->newest : kNaN;
}

bool SeenSpace::unknown_boxes(const Eigen::Vector3d& center_M, double radius, std::size_t max_boxes,
                              VoxelBoxes* boxes) const {
  boxes->clear();
  if (impl_->is_empty) return true;
  constexpr std::int32_t kFirstOfBlock = ~(kBlockSide - 1);
  const auto key = [&](double coordinate) {
    std::int32_t result = coordinate < 0.0 ? 0 : kKeyEnd - 1;
    impl_->scale.key(coordinate, &result);
    return result & kFirstOfBlock;
  };
  const Eigen::Vector3d low = center_M.array() - radius, high = center_M.array() + radius;
  impl_->append_outside(low, high, boxes);
  for (std::int32_t z = key(low.z()); z <= key(high.z()); z += kBlockSide) {
    for (std::int32_t y = key(low.y()); y <= key(high.y()); y += kBlockSide) {
      impl_->append_row({key(low.x()), y, z}, key(high.x()), center_M, radius, boxes);
      if (boxes->size() > max_boxes) {
        boxes->resize(max_boxes);
        return false;
      }
    }
  }
  return true;
}

}  // namespace ist
