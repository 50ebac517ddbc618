#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace ist {

/// Load flags of the tiles of an index: whether a tile holds its points, or they still lie in the
/// message. Every reader of a tile that is not loaded reads the points from the message into a
/// buffer of its own; the first one also stores them in the tile. Nobody waits.
class LazyTileFlags {
 public:
  /// Marks this many tiles as loaded. Not to be called while others read.
  void reset(std::size_t tiles) {
    const std::size_t words = (tiles + kTilesPerWord - 1) / kTilesPerWord;
    if (words > size_) {
      words_ = std::make_unique<std::atomic<std::uint32_t>[]>(words + words / 2);
      size_ = words + words / 2;
    }
    for (std::size_t i = 0; i < words; ++i) words_[i].store(kAll, std::memory_order_relaxed);
  }
  /// Marks tiles as not loaded. Not to be called while others read.
  void mark_not_loaded(std::size_t first, std::size_t count) {
    for (const std::size_t end = first + count; first < end;) {
      const std::size_t here =
          std::min<std::size_t>(end - first, kTilesPerWord - first % kTilesPerWord);
      const std::uint32_t bits = ((1U << here) - 1U) << (first % kTilesPerWord);
      std::atomic<std::uint32_t>& word = words_[first / kTilesPerWord];
      word.store(word.load(std::memory_order_relaxed) & ~(bits | bits << kTilesPerWord),
                 std::memory_order_relaxed);
      first += here;
    }
  }

  std::size_t memory() const { return size_ * sizeof words_[0]; }  ///< [bytes]

  bool is_loaded(std::size_t tile) const {
    return (words_[tile / kTilesPerWord].load(std::memory_order_acquire) & bit(tile)) != 0;
  }
  /// @returns true to one caller only, which is to store the points and then call publish()
  bool claim(std::size_t tile) const {
    const std::uint32_t claimed = bit(tile) << kTilesPerWord;
    return (words_[tile / kTilesPerWord].fetch_or(claimed, std::memory_order_relaxed) & claimed) ==
           0;
  }
  void publish(std::size_t tile) const {
    words_[tile / kTilesPerWord].fetch_or(bit(tile), std::memory_order_release);
  }

 private:
  static constexpr std::uint32_t kTilesPerWord = 16;  // low half: loaded, high half: claimed
  static constexpr std::uint32_t kAll = 0xFFFFFFFFU;
  static constexpr std::uint32_t bit(std::size_t tile) { return 1U << (tile % kTilesPerWord); }
  static_assert(std::atomic<std::uint32_t>::is_always_lock_free, "nobody may wait");

  std::unique_ptr<std::atomic<std::uint32_t>[]> words_;
  std::size_t size_ = 0;
};

}  // namespace ist
