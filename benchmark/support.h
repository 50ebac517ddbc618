#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

namespace ist::benchmark {

using Clock = std::chrono::steady_clock;

inline double microseconds_since(Clock::time_point start) {
  return 1e6 * std::chrono::duration<double>(Clock::now() - start).count();
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
