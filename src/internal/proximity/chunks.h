#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>

#include "internal/robot/threads.h"

namespace ist {

/// Hands out consecutive configurations to several threads.
class Chunks {
 public:
  /// Configurations that a thread takes at a time; all but the first have a warm start.
  static constexpr std::size_t kSize = 8;

  explicit Chunks(std::size_t count) : count_(count) {}

  /// Calls answer(k) for each configuration that the calling thread takes, until none is left.
  template <class Answer>
  void for_each(const Answer& answer) {
    for (std::size_t k; (k = next_.fetch_add(kSize)) < count_;) {
      const std::size_t end = std::min(k + kSize, count_);
      for (; k < end; ++k) answer(k);
    }
  }

  /// Lets no thread take another chunk.
  void stop() { next_ = count_; }

 private:
  const std::size_t count_;
  std::atomic<std::size_t> next_{0};
};

/// Calls work(i, chunks) once on each of up to `threads` threads, the caller's included; i counts
/// the threads from 0. No more threads are started than there are chunks. The first exception comes
/// out when all threads have ended.
template <class Work>
void run_in_chunks(std::size_t count, std::size_t threads, const Work& work) {
  Chunks chunks(count);
  const std::size_t useful = std::min(threads, (count + Chunks::kSize - 1) / Chunks::kSize);
  run_on_threads(useful, [&](std::size_t i) {
    try {
      work(i, &chunks);
    } catch (...) {
      chunks.stop();
      throw;
    }
  });
}

}  // namespace ist
