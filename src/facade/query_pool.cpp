#include "query_pool.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <system_error>
#include <thread>
#include <utility>

namespace ist {
namespace {

// Consecutive configurations that a thread takes at a time; all but the first have a warm start.
constexpr std::size_t kChunk = 8;

}  // namespace

std::unique_ptr<QueryWorker> QueryPool::take() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<QueryWorker> worker = std::move(idle_.back());
      idle_.pop_back();
      return worker;
    }
  }
  return make_();
}

void QueryPool::give_back(std::unique_ptr<QueryWorker> worker) {
  const std::lock_guard<std::mutex> lock(mutex_);
  idle_.push_back(std::move(worker));
}

void QueryPool::run(std::size_t count, int threads, const QueryConfig& config,
                    const std::function<void(QueryWorker*, std::size_t)>& answer) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      std::unique_ptr<QueryWorker> worker = take();
      worker->query.set_config(config);
      for (std::size_t k; (k = next.fetch_add(kChunk)) < count;) {
        const std::size_t end = std::min(k + kChunk, count);
        for (; k < end; ++k) answer(worker.get(), k);
      }
      give_back(std::move(worker));
    } catch (...) {
      next = count;
      const std::lock_guard<std::mutex> lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  const std::size_t wanted = threads > 0 ? static_cast<std::size_t>(threads)
                                         : std::max(1U, std::thread::hardware_concurrency());
  const std::size_t useful = std::min(wanted, (count + kChunk - 1) / kChunk);
  std::vector<std::thread> others;
  try {
    while (others.size() + 1 < useful) others.emplace_back(work);
  } catch (const std::system_error&) {
    // The system has no more threads; those that run answer all configurations.
  }
  work();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace ist
