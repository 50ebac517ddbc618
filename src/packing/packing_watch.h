#pragma once

#include <chrono>
#include <utility>

#include "ist_proximity/packing/packing.h"

namespace ist {

/// Asks a packing's progress callback whether to go on. Every loop of a packing calls keeps_on() at
/// each step; the callback is called when kInterval has passed since its last call. Not thread
/// safe. A callback that has asked to stop is not called again.
class PackingWatch {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kInterval{20};

  /// @param progress  may be empty
  explicit PackingWatch(PackingProgress progress) : progress_(std::move(progress)) {}

  /// The next steps go from `from` to `to` of the whole.
  void begin_part(double from, double to) {
    from_ = from;
    to_ = to;
    done_ = 0.0;
  }

  /// Calls the callback with the share of this part that is done (0 to 1).
  /// @returns false when the packing has to stop
  bool report(double done) {
    if (stopped_) return false;
    done_ = done > done_ ? done : done_;
    last_ = Clock::now();
    stopped_ = progress_ && !progress_(from_ + (to_ - from_) * done_);
    return !stopped_;
  }

  /// Calls the callback with what was reported last, if that is kInterval ago.
  /// @returns false when the packing has to stop
  bool keeps_on() {
    if (stopped_ || !progress_) return !stopped_;
    return Clock::now() - last_ < kInterval || report(done_);
  }

  bool stopped() const { return stopped_; }

 private:
  PackingProgress progress_;
  double from_ = 0.0, to_ = 1.0, done_ = 0.0;
  Clock::time_point last_ = Clock::now();
  bool stopped_ = false;
};

}  // namespace ist
