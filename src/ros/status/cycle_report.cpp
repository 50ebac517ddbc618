#include "ros/status/cycle_report.h"

#include <algorithm>
#include <limits>

namespace ist {

void CycleTimes::add(double seconds) {
  if (ring_.size() < kKept) {
    ring_.push_back(seconds);
  } else {
    ring_[total_ % kKept] = seconds;
  }
  ++total_;
}

double CycleTimes::quantile(double q) const {
  if (ring_.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<double> sorted = ring_;
  std::sort(sorted.begin(), sorted.end());
  const auto rank = static_cast<std::size_t>(q * static_cast<double>(sorted.size()));
  return sorted[std::min(rank, sorted.size() - 1)];
}

}  // namespace ist
