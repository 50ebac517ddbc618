#pragma once

#include <chrono>

namespace ist {

/// Times the parts of a work, one after the other.
class Stopwatch {
 public:
  using Clock = std::chrono::steady_clock;

  /// [s] Since the last lap, or since the start.
  double lap() {
    const Clock::time_point now = Clock::now();
    const std::chrono::duration<double> took = now - last_;
    last_ = now;
    return took.count();
  }

 private:
  Clock::time_point last_ = Clock::now();
};

}  // namespace ist
