#include "cloud/memory/octree_writer.h"

#include <algorithm>
#include <utility>

#include "cloud/memory/block_bits.h"

namespace ist {
namespace {

// Two bits a child, as octomap writes them.
constexpr unsigned kUnknown = 0, kFree = 1, kOccupied = 2, kInner = 3;
constexpr int kBlockDepth = 13;  // level at which a node is a block
constexpr std::size_t kNodeBytes = 2;

// Bits of x, y and z in turn, so that blocks of one node are neighbours in the order.
std::uint64_t interleaved(std::uint64_t id) {
  const VoxelKey key = first_voxel(id);
  std::uint64_t code = 0;
  for (unsigned bit = 0; bit < kBlockDepth; ++bit) {
    const unsigned from = bit + kBlockBits;
    code |= static_cast<std::uint64_t>(key.x >> from & 1) << (3 * bit) |
            static_cast<std::uint64_t>(key.y >> from & 1) << (3 * bit + 1) |
            static_cast<std::uint64_t>(key.z >> from & 1) << (3 * bit + 2);
  }
  return code;
}

class Writer {
 public:
  explicit Writer(const VoxelBlocks& blocks) {
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      ordered_.emplace_back(interleaved(blocks[i].id), &blocks[i]);
    }
    std::sort(ordered_.begin(), ordered_.end());
  }

  // Writes the root and all below it; a root that is no inner node has eight equal children.
  std::vector<std::uint8_t> run(std::size_t* nodes) {
    const unsigned root = node(0, ordered_.size(), 0);
    if (root == kFree || root == kOccupied) {
      const unsigned all = root * 0x5555U;  // the same code for each child
      bytes_ = {static_cast<std::uint8_t>(all), static_cast<std::uint8_t>(all >> 8U)};
      nodes_ += 8;
    }
    *nodes = root == kUnknown ? 0 : nodes_ + 1;
    if (root == kUnknown) bytes_.clear();
    return std::move(bytes_);
  }

 private:
  // Writes a node's children. A node that has none is not written.
  // @param begin, end  of the blocks in it
  // @returns its code
  unsigned node(std::size_t begin, std::size_t end, int depth) {
    if (begin == end) return kUnknown;
    if (depth == kBlockDepth) {
      block_ = ordered_[begin].second;
      return voxels({0, 0, 0}, kBlockSide);
    }
    const unsigned shift = 3U * static_cast<unsigned>(kBlockDepth - depth - 1);
    std::size_t at = begin;
    return children([&](unsigned child) {
      std::size_t next = at;
      while (next < end && (ordered_[next].first >> shift & 7U) == child) ++next;
      const unsigned code = node(at, next, depth + 1);
      at = next;
      return code;
    });
  }

  // The same for a cube of a block.
  unsigned voxels(const VoxelKey& low, int side) {
    if (side == 1) {
      const unsigned place = place_in_block(low);
      if (!test_bit(block_->known, place)) return kUnknown;
      return test_bit(block_->occupied, place) ? kOccupied : kFree;
    }
    const int half = side / 2;
    return children([&](unsigned child) {
      const auto bit = [&](unsigned i) { return half * static_cast<int>(child >> i & 1U); };
      return voxels({low.x + bit(0), low.y + bit(1), low.z + bit(2)}, half);
    });
  }

  template <typename Child>
  unsigned children(const Child& child_code) {
    const std::size_t at = bytes_.size(), nodes_before = nodes_;
    bytes_.resize(at + kNodeBytes);
    unsigned codes = 0;
    for (unsigned child = 0; child < 8; ++child) {
      const unsigned code = child_code(child);
      codes |= code << (2 * child);
      if (code != kUnknown) ++nodes_;
    }
    for (const unsigned leaf : {kUnknown, kFree, kOccupied}) {
      if (codes != leaf * 0x5555U) continue;
      bytes_.resize(at);
      nodes_ = nodes_before;
      return leaf;
    }
    bytes_[at] = static_cast<std::uint8_t>(codes);
    bytes_[at + 1] = static_cast<std::uint8_t>(codes >> 8U);
    return kInner;
  }

  std::vector<std::pair<std::uint64_t, const VoxelBlock*>> ordered_;
  const VoxelBlock* block_ = nullptr;
  std::vector<std::uint8_t> bytes_;
  std::size_t nodes_ = 0;  // without the root
};

}  // namespace

std::vector<std::uint8_t> write_octree(const VoxelBlocks& blocks, std::size_t* nodes) {
  return Writer(blocks).run(nodes);
}

}  // namespace ist
