#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// When a computation has to end.
class Deadline {
 public:
  /// Tests stop a computation at any of its steps: with 0 or more, the deadline passes after so
  /// many questions, whatever the clock says. Negative: the clock decides. Not for other use.
  static inline std::int64_t asks_left_for_test = -1;

  /// @param end  TimePoint::max(): never
  explicit Deadline(TimePoint end) : end_(end), limited_(end != TimePoint::max()) {}
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
    if (!limited_ || passed_) return passed_;
    passed_ = asks_left_for_test >= 0 ? asks_left_for_test-- == 0
                                      : std::chrono::steady_clock::now() >= end_;
    return passed_;
  }

  /// The same for steps that take no longer than the clock does: looks at it every `interval`
  /// calls.
  bool passed_now_and_then(std::uint32_t interval) {
    return ++calls_ % interval == 0 ? passed() : passed_;
  }

 private:
  static constexpr double kLongest = 1e6;  ///< [s] what the clock can represent
  TimePoint end_;
  bool limited_;
  bool passed_ = false;
  std::uint32_t calls_ = 0;  ///< of passed_now_and_then()
};

}  // namespace ist
