#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace ist {

/// The obstacles of an index that a traversal has refined: several sphere leaves meet the same one.
/// A direct-mapped table of fixed size: an obstacle whose place another one took counts as new.
class VisitedSet {
 public:
  void clear() {
    if (++epoch_ != 0) return;
    entries_.fill({});  // the number wrapped around: entries of old epochs must not come back
    epoch_ = 1;
  }

  bool contains(std::uint32_t key) const {
    const Entry& entry = entries_[slot(key)];
    return entry.epoch == epoch_ && entry.key == key;
  }
  /// @returns whether it was not in the set
  bool insert(std::uint32_t key) {
    const bool is_new = !contains(key);
    entries_[slot(key)] = {epoch_, key};
    return is_new;
  }

 private:
  struct Entry {
    std::uint32_t epoch = 0, key = 0;
  };
  static std::size_t slot(std::uint32_t key) { return (key * 2654435761U) >> 23U; }

  std::array<Entry, 512> entries_{};
  std::uint32_t epoch_ = 1;
};

}  // namespace ist
