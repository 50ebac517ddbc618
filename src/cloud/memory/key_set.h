#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/memory/voxel_blocks.h"

namespace ist {

/// A set of voxels that is emptied at once, and keeps its memory.
class KeySet {
 public:
  KeySet() : slots_(1024, kEmpty) {}

  void clear() {
    for (const std::size_t slot : used_) slots_[slot] = kEmpty;
    used_.clear();
  }
  /// @returns whether the voxel is new
  bool insert(const VoxelKey& key) {
    if (2 * (used_.size() + 1) > slots_.size()) grow();
    const std::uint64_t number = static_cast<std::uint64_t>(key.x) |
                                 static_cast<std::uint64_t>(key.y) << 16U |
                                 static_cast<std::uint64_t>(key.z) << 32U;
    const std::size_t slot = slot_of(number);
    if (slots_[slot] == number) return false;
    slots_[slot] = number;
    used_.push_back(slot);
    return true;
  }

 private:
  static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};  // no key: 48 bits are used

  std::size_t slot_of(std::uint64_t number) const {
    const std::size_t mask = slots_.size() - 1;
    std::size_t slot = (number * 0x9E3779B97F4A7C15U >> 32U) & mask;  // Fibonacci hashing (Knuth)
    while (slots_[slot] != kEmpty && slots_[slot] != number) slot = (slot + 1) & mask;
    return slot;
  }
  void grow() {
    std::vector<std::uint64_t> numbers;
    numbers.reserve(used_.size());
    for (const std::size_t slot : used_) numbers.push_back(slots_[slot]);
    slots_.assign(2 * slots_.size(), kEmpty);
    used_.clear();
    for (const std::uint64_t number : numbers) {
      const std::size_t slot = slot_of(number);
      slots_[slot] = number;
      used_.push_back(slot);
    }
  }

  std::vector<std::uint64_t> slots_;
  std::vector<std::size_t> used_;
};

}  // namespace ist
