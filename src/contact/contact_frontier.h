#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace ist {

/// Groups of an obstacle that are still to be summed, the one with the greatest possible volume
/// first, so that the volume known grows as fast as the bounds can tell. The storage lies within
/// the object; who finds it full visits a group's members at once instead.
class ContactFrontier {
 public:
  struct Entry {
    double bound;         ///< [m^3] the group shares no more with the link
    std::uint32_t index;  ///< number of the hierarchy
    std::int32_t child;   ///< of the hierarchy
  };

  // NOLINTNEXTLINE(modernize-use-equals-default): `= default` and {} would write zeros
  ContactFrontier() {}

  bool empty() const { return size_ == 0; }
  bool has_room(std::size_t count) const { return size_ + count <= kCapacity; }

  /// @pre has_room(1)
  void push(const Entry& entry) {
    entries_[size_++] = entry;
    std::push_heap(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(size_), less);
  }

  Entry pop() {
    std::pop_heap(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(size_), less);
    return entries_[--size_];
  }

 private:
  static constexpr std::size_t kCapacity = 1024;
  static bool less(const Entry& a, const Entry& b) { return a.bound < b.bound; }

  std::array<Entry, kCapacity> entries_;
  std::size_t size_ = 0;
};

}  // namespace ist
