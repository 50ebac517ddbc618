#include "query_pool.h"

#include <utility>

#include "internal/proximity/chunks.h"

namespace ist {

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
  run_in_chunks(count, thread_count(threads), [&](std::size_t, Chunks* chunks) {
    std::unique_ptr<QueryWorker> worker = take();
    worker->query.set_config(config);
    chunks->for_each([&](std::size_t k) { answer(worker.get(), k); });
    give_back(std::move(worker));
  });
}

}  // namespace ist
