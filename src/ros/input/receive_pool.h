#pragma once

#include <atomic>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <mutex>
#include <vector>

namespace ist {

/// Messages that are received into again, with the memory that they have, once nobody else holds
/// them: a camera's cloud is some megabytes, which would be allocated, filled with zeros and freed
/// with each one. Thread safe, since roscpp lets subscribers of one topic share a message, whoever
/// reads it.
/// @tparam Message  its bytes are in `data`
template <typename Message>
class ReceivePool {
 public:
  using Pointer = boost::shared_ptr<Message>;

  /// A message that nobody else holds, to be filled.
  Pointer take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    Pointer free;
    for (std::size_t i = 0; i < pool_.size();) {
      if (pool_[i].use_count() > 1) {
        ++i;
        continue;
      }
      // Messages that have waited for transforms leave others behind: one is enough.
      if (!free && !is_oversized(*pool_[i])) free = pool_[i];
      pool_[i].swap(pool_.back());
      pool_.pop_back();
    }
    // use_count() alone does not order what the last holder read before what is written now.
    std::atomic_thread_fence(std::memory_order_acquire);
    if (!free) free = boost::make_shared<Message>();
    pool_.push_back(free);
    return free;
  }

 private:
  // The memory of one huge message is not kept for small ones.
  static bool is_oversized(const Message& message) {
    return message.data.capacity() > 2 * message.data.size();
  }

  std::mutex mutex_;
  std::vector<Pointer> pool_;  ///< the one to be used next, and those that somebody holds
};

}  // namespace ist
