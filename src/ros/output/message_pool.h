#pragma once

#include <array>
#include <atomic>
#include <boost/make_shared.hpp>
#include <cstddef>

namespace ist {

/// Messages that are used again, with the memory that they have, once nobody else holds them.
/// Subscribers within the process hold a message that was published as a pointer for as long as
/// they like; while all are held, new ones are made. One thread.
template <typename Message>
class MessagePool {
 public:
  using Pointer = boost::shared_ptr<Message>;

  /// A message that nobody else holds, with whatever it had when it was used last.
  Pointer take() {
    for (std::size_t i = 0; i < pool_.size(); ++i) {
      Pointer& message = pool_[next_];
      next_ = (next_ + 1) % pool_.size();
      if (message && message.use_count() > 1) continue;
      if (!message) message = boost::make_shared<Message>();
      // use_count() alone does not order what the last holder read before what is written now.
      std::atomic_thread_fence(std::memory_order_acquire);
      return message;
    }
    Pointer& oldest = pool_[next_];
    next_ = (next_ + 1) % pool_.size();
    oldest = boost::make_shared<Message>();
    return oldest;
  }

 private:
  std::array<Pointer, 8> pool_;
  std::size_t next_ = 0;
};

}  // namespace ist
