#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

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

/// The threads that are wanted.
/// @param threads  0: one for each core
inline std::size_t thread_count(int threads) {
  return threads > 0 ? static_cast<std::size_t>(threads)
                     : std::max(1U, std::thread::hardware_concurrency());
}

/// Calls work(i, chunks) once on each of up to `threads` threads, the caller's included; i counts
/// the threads from 0. No more threads are started than there are chunks. The first exception comes
/// out when all threads have ended.
template <class Work>
void run_in_chunks(std::size_t count, std::size_t threads, const Work& work) {
  Chunks chunks(count);
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto guarded = [&](std::size_t i) {
    try {
      work(i, &chunks);
    } catch (...) {
      chunks.stop();
      const std::lock_guard<std::mutex> lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  const std::size_t useful = std::min(threads, (count + Chunks::kSize - 1) / Chunks::kSize);
  std::vector<std::thread> others;
  try {
    while (others.size() + 1 < useful) others.emplace_back(guarded, others.size() + 1);
  } catch (const std::system_error&) {
    // The system has no more threads; those that run answer all configurations.
  }
  guarded(0);
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace ist
