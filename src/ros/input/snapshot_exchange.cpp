#include "ros/input/snapshot_exchange.h"

#include <atomic>

namespace ist {

SourceSnapshot& SnapshotExchange::writable() {
  std::shared_ptr<SourceSnapshot>& snapshot = channel_.back();
  if (!snapshot || snapshot.use_count() > 1) snapshot = std::make_shared<SourceSnapshot>();
  // use_count() alone does not order what the last holder read before what is written now.
  std::atomic_thread_fence(std::memory_order_acquire);
  return *snapshot;
}

void SnapshotExchange::publish() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    shared_ = channel_.back();
  }
  channel_.publish();
}

const std::shared_ptr<SourceSnapshot>& SnapshotExchange::newest() {
  channel_.update();
  return channel_.front();
}

std::shared_ptr<const SourceSnapshot> SnapshotExchange::share() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return shared_;
}

}  // namespace ist
