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

/// How many threads a setting means; 0: as many as there are cores.
inline std::size_t thread_count(int threads) {
  return threads > 0 ? static_cast<std::size_t>(threads)
                     : std::max(1U, std::thread::hardware_concurrency());
}

/// Calls work(i) once on each of `threads` threads, the caller's included; i counts them from 0.
/// Fewer are started where the system has no more. The first exception comes out when all threads
/// have ended.
template <class Work>
void run_on_threads(std::size_t threads, const Work& work) {
  std::exception_ptr failure;
  std::mutex mutex;
  const auto guarded = [&](std::size_t i) {
    try {
      work(i);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  std::vector<std::thread> others;
  try {
    while (others.size() + 1 < threads) others.emplace_back(guarded, others.size() + 1);
  } catch (const std::system_error&) {
    // Fewer threads do the same.
  }
  guarded(0);
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

/// Calls function(i) for each i < count, on several threads. After an exception no further call
/// begins; the first one comes out.
/// @param threads  0: as many as there are cores
template <class Function>
void for_each_in_parallel(std::size_t count, int threads, const Function& function) {
  std::atomic<std::size_t> next{0};
  run_on_threads(std::min(count, thread_count(threads)), [&](std::size_t) {
    try {
      for (std::size_t i; (i = next++) < count;) function(i);
    } catch (...) {
      next = count;
      throw;
    }
  });
}

}  // namespace ist
