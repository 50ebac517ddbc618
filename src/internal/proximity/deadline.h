#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// When a share of a deadline has passed.
/// @param deadline  [s] from `begin`; 0: there is none
inline TimePoint end_of(double deadline, double share, TimePoint begin) {
  if (!(deadline > 0.0)) return TimePoint::max();
  return begin + std::chrono::duration_cast<TimePoint::duration>(
                     std::chrono::duration<double>(share * deadline));
}

/// When a computation has to end.
class Deadline {
 public:
  /// Tests stop a computation at any of its steps: with 0 or more, the deadline passes after so
  /// many questions, whatever the clock says. Negative: the clock decides. Not for other use.
  static inline std::int64_t asks_left_for_test = -1;

  /// [s] Tests say by how much a deadline has passed where the clock would depend on what else the
  /// machine does. Negative: the clock decides. Not for other use.
  static inline double late_for_test = -1.0;

  /// @param end  TimePoint::max(): never
  explicit Deadline(TimePoint end) : end_(end), limited_(end != TimePoint::max()) {}
  /// @param seconds  from now; 0: never
  explicit Deadline(double seconds) : limited_(seconds > 0.0) {
    if (!limited_) return;
    end_ = std::chrono::steady_clock::now() +
           std::chrono::duration_cast<std::chrono::steady_clock::duration>(
               std::chrono::duration<double>(std::min(seconds, kLongest)));
  }

  /// A share of the time that is left: it passes when a deadline that many times nearer would, and
  /// with the whole one at the latest.
  /// @param whole    outlives the share
  /// @param divisor  > 0
  Deadline(Deadline* whole, std::size_t divisor)
      : end_(whole->end_), limited_(whole->limited_), whole_(whole) {
    if (!limited_) return;
    const auto now = std::chrono::steady_clock::now();
    if (end_ > now) end_ = now + (end_ - now) / static_cast<std::int64_t>(divisor);
  }

  /// Whether passed() has been true.
  bool has_passed() const { return passed_; }

  /// Once true, always true.
  bool passed() {
    if (!limited_ || passed_) return passed_;
    const TimePoint now = std::chrono::steady_clock::now();
    if (whole_ != nullptr) {
      passed_ = whole_->passed() || now >= end_;
    } else {
      passed_ = asks_left_for_test >= 0 ? asks_left_for_test-- == 0 : now >= end_;
    }
    if (passed_) passed_at_ = now;
    return passed_;
  }

  /// Whether so much time has gone by since passed() was true for the first time.
  bool passed_by(double seconds) {
    if (!passed()) return false;
    if (late_for_test >= 0.0) return late_for_test >= seconds;
    if (whole_ != nullptr && whole_->has_passed()) return whole_->passed_by(seconds);
    return std::chrono::steady_clock::now() - passed_at_ >= std::chrono::duration<double>(seconds);
  }

  /// The same for steps that take no longer than the clock does: looks at it every `interval`
  /// calls.
  bool passed_now_and_then(std::uint32_t interval) {
    return ++calls_ % interval == 0 ? passed() : passed_;
  }

 private:
  static constexpr double kLongest = 1e6;  ///< [s] what the clock can represent
  TimePoint end_;
  TimePoint passed_at_;  ///< when passed() was true for the first time
  bool limited_;
  Deadline* whole_ = nullptr;  ///< of which this is a share
  bool passed_ = false;
  std::uint32_t calls_ = 0;  ///< of passed_now_and_then()
};

}  // namespace ist
