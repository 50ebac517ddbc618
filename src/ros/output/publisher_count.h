#pragma once

#include <ros/subscriber.h>

#include <chrono>
#include <cstdint>
#include <optional>

namespace ist {

/// How many publishers a subscriber has, asked now and then: roscpp's answer can wait for the
/// master, so no lock should be held. Not thread safe.
class PublisherCount {
 public:
  /// The number, where it is time to ask again.
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
