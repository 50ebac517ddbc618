#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace ist {

/// Lower bounds of boxes of a BVH for a link, kept within one traversal: several pairs share a box.
/// A direct-mapped table of fixed size.
class BoxBounds {
 public:
  void clear() { entries_.fill({}); }

  /// Null: not known.
  float* find(std::int32_t slot) {
    Entry& entry = at(slot);
    return entry.slot == slot ? &entry.bound : nullptr;
  }
  float insert(std::int32_t slot, float bound) {
    at(slot) = {slot, bound};
    return bound;
  }

 private:
  struct Entry {
    std::int32_t slot = -1;
    float bound = 0.0F;  // [m]
  };
  static constexpr std::size_t kEntries = 256;
  Entry& at(std::int32_t slot) {
    return entries_[(static_cast<std::uint32_t>(slot) * 2654435761U) >> 24U];
  }
  std::array<Entry, kEntries> entries_{};
};

}  // namespace ist
