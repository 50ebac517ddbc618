#pragma once

#include <algorithm>
#include <chrono>

namespace ist {

/// When a query has to end.
class Deadline {
 public:
  /// @param seconds  from now; 0: never
  explicit Deadline(double seconds) : limited_(seconds > 0.0) {
    if (!limited_) return;
    end_ = std::chrono::steady_clock::now() +
           std::chrono::duration_cast<std::chrono::steady_clock::duration>(
               std::chrono::duration<double>(std::min(seconds, kLongest)));
  }

  /// Whether passed() has been true.
  bool has_passed() const { return passed_; }

  /// Once true, always true.
  bool passed() {
    if (limited_ && !passed_) passed_ = std::chrono::steady_clock::now() >= end_;
    return passed_;
  }

 private:
  static constexpr double kLongest = 1e6;  ///< [s] what the clock can represent
  std::chrono::steady_clock::time_point end_;
  bool limited_;
  bool passed_ = false;
};

}  // namespace ist
