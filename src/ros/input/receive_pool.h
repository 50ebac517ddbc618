#pragma once

#include <algorithm>
#include <atomic>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <mutex>
#include <vector>

#include "ros/common/memory.h"

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

  /// The pool keeps as many messages as were held at a time while this number was taken: ten
  /// seconds of 30 Hz.
  static constexpr unsigned kWindow = 300;

  /// A message that nobody else holds, to be filled.
  Pointer take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto is_free = [](const Pointer& message) { return message.use_count() == 1; };
    pool_.erase(std::remove_if(pool_.begin(), pool_.end(),
                               [&](const Pointer& message) {
                                 return is_free(message) && is_oversized(*message);
                               }),
                pool_.end());
    auto free = std::find_if(pool_.begin(), pool_.end(), is_free);
    // use_count() alone does not order what the last holder read before what is written now.
    std::atomic_thread_fence(std::memory_order_acquire);
    if (free == pool_.end()) free = pool_.insert(free, boost::make_shared<Message>());
    Pointer taken = *free;
    const auto free_now = std::count_if(pool_.begin(), pool_.end(), is_free);
    most_held_ = std::max(most_held_, pool_.size() - static_cast<std::size_t>(free_now));
    if (++taken_ % kWindow == 0) forget_spares();
    return taken;
  }

 private:
  // The memory of one huge message is not kept for small ones.
  static bool is_oversized(const Message& message) {
    return message.data.capacity() > 2 * message.data.size();
  }

  // Frees messages that were needed while clouds waited for transforms, and are not any more. They
  // lie between others in the heap, which would keep their pages.
  void forget_spares() {
    bool is_freed = false;
    for (std::size_t i = pool_.size(); i-- > 0 && pool_.size() > most_held_;) {
      if (pool_[i].use_count() > 1) continue;
      pool_.erase(pool_.begin() + static_cast<std::ptrdiff_t>(i));
      is_freed = true;
    }
    most_held_ = 0;
    if (is_freed) return_free_memory();
  }

  std::mutex mutex_;
  std::vector<Pointer> pool_;
  std::size_t most_held_ = 0;  ///< at a time, in this window
  unsigned taken_ = 0;
};

}  // namespace ist
