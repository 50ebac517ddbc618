#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>

namespace ist {

/// The usual time between two messages, as their receipts tell it: the mean over the last ones, so
/// that messages that come in bursts count by their rate. note() in one thread, seconds() in any.
class UsualPeriod {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param longest  [s] assumed before enough messages came; a longer pause counts as this
  explicit UsualPeriod(double longest) : longest_(longest), period_(longest) {}

  /// A message has come.
  void note(Clock::time_point now) {
    if (count_++ > 0) {
      const std::chrono::duration<double> interval = now - last_;
      const auto weight = static_cast<double>(std::min(count_ - 1, kWindow));
      mean_ += (std::min(interval.count(), longest_) - mean_) / weight;
      if (count_ > kEnough) period_ = mean_;
    }
    last_ = now;
  }

  /// [s]
  double seconds() const { return period_; }

 private:
  static constexpr std::size_t kWindow = 64, kEnough = 16;

  const double longest_;
  double mean_ = 0.0;
  std::size_t count_ = 0;
  Clock::time_point last_;
  std::atomic<double> period_;
};

}  // namespace ist
