#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace ist {

/// Hands the newest value from one writer thread to one reader thread without locks (triple
/// buffering): the writer owns one slot, the reader another, and the third is exchanged between
/// them. Neither side ever waits, allocates or frees; values are overwritten in place, by the
/// writer only.
template <typename T>
class SnapshotChannel {
 public:
  /// Writer: the slot to fill next. It holds an old value, so that its buffers can be reused.
  T& back() { return slots_[back_]; }

  /// Writer: makes back() the newest value.
  void publish() {
    // Releases the writes to the slot, and acquires the slot that comes back, which the reader has
    // given up.
    const std::uint8_t fresh = back_ | kFresh;
    back_ = waiting_.exchange(fresh, std::memory_order_acq_rel) & kIndex;
  }

  /// Reader: takes the newest value. @returns false when none was published since the last call
  bool update() {
    // Relaxed: a value published right now is taken next time, and the exchange below orders all.
    if ((waiting_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    front_ = waiting_.exchange(front_, std::memory_order_acq_rel) & kIndex;
    return true;
  }

  /// Reader: the value taken last (default constructed before the first update).
  const T& front() const { return slots_[front_]; }
  /// Reader: the same, for the reader to change.
  T& front() { return slots_[front_]; }

 private:
  static constexpr std::uint8_t kIndex = 3, kFresh = 4;
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free, "neither side may wait");

  // One cache line each, so that the threads do not slow each other down.
  static constexpr std::size_t kCacheLine = 64;

  std::array<T, 3> slots_{};
  alignas(kCacheLine) std::uint8_t back_ = 0;                 // writer's
  alignas(kCacheLine) std::atomic<std::uint8_t> waiting_{1};  // index, and whether it is fresh
  alignas(kCacheLine) std::uint8_t front_ = 2;                // reader's
};

}  // namespace ist
