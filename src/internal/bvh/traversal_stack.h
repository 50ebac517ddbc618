#pragma once

#include <cassert>
#include <cstddef>
#include <exception>
#include <type_traits>

namespace ist {

/// The most entries that a depth-first traversal ever holds: the root, and for each level of inner
/// nodes on the way down the children of one node instead of the node itself.
/// @param levels  inner nodes on the longest path from the root to a leaf. A dual-tree traversal
///                descends in one tree at a time: the sum of both, with the larger width.
/// @param width   children of a node, at most
constexpr std::size_t stack_capacity(std::size_t levels, std::size_t width) {
  return 1 + levels * (width - 1);
}

/// Levels of inner nodes of a tree whose leaves have 31-bit numbers and whose nodes, above the
/// lowest level, are full but for the last one of each level.
constexpr std::size_t full_tree_levels(std::size_t width) {
  std::size_t levels = 1;  // the lowest, whose nodes may hold a single leaf each
  for (std::size_t reached = 1; reached < std::size_t{1} << 31; reached *= width) ++levels;
  return levels;
}

/// Nodes that a depth-first traversal has still to visit; the next one is on top. The storage lies
/// within the object and is not initialized; nothing is allocated.
///
/// Overflow policy: the capacity follows from the tree's greatest depth (stack_capacity), which its
/// builder guarantees, so the stack cannot overflow. Where that is broken, an assertion fails in
/// debug builds and std::terminate() ends the program in release builds: an entry is never dropped
/// and nothing is written outside the storage. Popping from an empty stack is undefined.
///
/// Entries are sorted by a member, not by a function: code compiled for a wider instruction set
/// could not be inlined here, but this can be inlined there.
/// @tparam Entry  a plain struct without default member values
template <typename Entry, std::size_t kCapacity>
class TraversalStack {
 public:
  static_assert(std::is_trivially_default_constructible_v<Entry> &&
                    std::is_trivially_copyable_v<Entry>,
                "the storage is not initialized");

  TraversalStack() {}  // NOLINT(modernize-use-equals-default): `= default` and {} would write zeros

  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }
  void clear() { size_ = 0; }

  [[gnu::always_inline]] void push(const Entry& entry) { *grow() = entry; }

  /// Pushes an entry for the caller to fill in; its content is undefined before.
  [[gnu::always_inline]] Entry& push() { return *grow(); }

  [[gnu::always_inline]] Entry pop() { return entries_[--size_]; }

  /// Pushes a child among its siblings so that the one with the least `kKey` is on top. Of equal
  /// ones the last is.
  /// @param first  size() before the first sibling was pushed
  template <auto kKey>
  [[gnu::always_inline]] void push_least_on_top(std::size_t first, const Entry& entry) {
    Entry* at = grow();
    for (Entry* const begin = entries_ + first; at > begin && at[-1].*kKey < entry.*kKey; --at) {
      *at = at[-1];
    }
    *at = entry;
  }

  /// The same with the greatest `kKey` on top.
  template <auto kKey>
  [[gnu::always_inline]] void push_greatest_on_top(std::size_t first, const Entry& entry) {
    Entry* at = grow();
    for (Entry* const begin = entries_ + first; at > begin && at[-1].*kKey > entry.*kKey; --at) {
      *at = at[-1];
    }
    *at = entry;
  }

 private:
  [[gnu::always_inline]] Entry* grow() {
    assert(size_ < kCapacity);
    if (size_ >= kCapacity) std::terminate();
    return entries_ + size_++;
  }

  std::size_t size_ = 0;
  Entry entries_[kCapacity];
};

}  // namespace ist
