#pragma once

#include <ros/subscriber.h>

#include <chrono>
#include <cstdint>
#include <optional>

namespace ist {

/// Counts the publishers of a subscribed topic twice a second. The call to roscpp may wait for the
/// master, so no lock should be held around ask(). Not thread safe.
class PublisherCount {
 public:
  /// Returns the number when it is due, else nothing.
  std::optional<std::uint32_t> ask(const ros::Subscriber& subscriber) {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return std::nullopt;
    next_ = now + std::chrono::milliseconds(500);
    return subscriber.getNumPublishers();
  }

 private:
  std::chrono::steady_clock::time_point next_;
};

}  // namespace ist
