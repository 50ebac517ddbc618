#pragma once

#include <ros/time.h>

#include <atomic>
#include <cstdint>
#include <limits>

namespace ist {

/// A while of the ROS clock. A clock that has gone back to before its begin ends it. What has been
/// found to be over stays over, wherever the clock goes. Thread safe.
class Lifetime {
 public:
  /// @param seconds  > 0; 0: it never ends
  Lifetime(double seconds, const ros::Time& now) { begin(seconds, now); }

  void begin(double seconds, const ros::Time& now) {
    begin_ = seconds > 0.0 ? now.toNSec() : 0;
    end_ = seconds > 0.0 ? now.toNSec() + static_cast<std::uint64_t>(1e9 * seconds) : kNever;
  }
  bool is_over(const ros::Time& now) const {
    const std::uint64_t time = now.toNSec();
    std::uint64_t end = end_;
    if (time >= begin_ && time < end) return false;
    // Another thread may have read the clock just before begin().
    if (time >= end || time + kRace < begin_) end_.compare_exchange_strong(end, 0);
    return true;
  }
  /// [s] +inf: it never ends.
  double left(const ros::Time& now) const {
    const std::uint64_t end = end_;
    if (end == kNever) return std::numeric_limits<double>::infinity();
    return 1e-9 * (static_cast<double>(end) - static_cast<double>(now.toNSec()));
  }

 private:
  static constexpr std::uint64_t kNever = std::numeric_limits<std::uint64_t>::max();
  static constexpr std::uint64_t kRace = 100'000'000;  // [ns]
  std::atomic<std::uint64_t> begin_{0};                ///< [ns]
  mutable std::atomic<std::uint64_t> end_{kNever};     ///< [ns] 0: it has been found to be over
};

}  // namespace ist
