#pragma once

#include <time.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <utility>
#include <vector>

namespace ist::benchmark {

using Clock = std::chrono::steady_clock;

inline double microseconds_since(Clock::time_point start) {
  return 1e6 * std::chrono::duration<double>(Clock::now() - start).count();
}

/// Measures the processor time of this thread, so that other load on the machine does not count.
/// lap() returns [us] since the last call.
class ThreadTimer {
 public:
  ThreadTimer() { lap(); }
  double lap() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    const double us =
        1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
    return us - std::exchange(last_, us);
  }

 private:
  double last_ = 0.0;
};

inline double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

/// The q-quantile, q from 0 to 1; 0 without values.
inline double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  const auto at =
      std::min(values.size() - 1, static_cast<std::size_t>(q * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

}  // namespace ist::benchmark
