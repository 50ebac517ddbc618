#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>

namespace ist {

/// Lets one thread sleep until a time, an event or the end of its work. Thread safe.
class StopSignal {
 public:
  using Clock = std::chrono::steady_clock;

  /// Ends all sleeps, now and from now on.
  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopped_ = true;
    }
    condition_.notify_all();
  }

  bool stopped() const { return stopped_; }

  /// Tells that an event may have come, so that the sleeping thread looks.
  void notify() {
    { const std::lock_guard<std::mutex> lock(mutex_); }  // the thread looks before, or sleeps now
    condition_.notify_all();
  }

  /// Sleeps until a time.
  /// @returns false when stopped
  bool sleep_until(Clock::time_point time) {
    return sleep_until(time, [] { return false; });
  }

  /// Sleeps until a time, or until `has_event` is true, which is looked at after each notify().
  /// @returns false when stopped
  template <typename Predicate>
  bool sleep_until(Clock::time_point time, const Predicate& has_event) {
    std::unique_lock<std::mutex> lock(mutex_);
    condition_.wait_until(lock, time, [&] { return stopped_ || has_event(); });
    return !stopped_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable condition_;
  std::atomic<bool> stopped_{false};
};

}  // namespace ist
