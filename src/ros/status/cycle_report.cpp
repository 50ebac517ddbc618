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

void CycleReport::take(const StatusInput& input, const Findings& found, const Status& decided) {
  status = decided;
  sources = input.sources;
  findings = found;
}

void CycleReport::add_times(const ist_proximity::ProximityArray& message) {
  times.add(message.computation_time);
  parts[kPartPoses].add(message.poses_time);
  parts[kPartQuery].add(message.query_time);
  parts[kPartRepulsion].add(message.repulsion_time);
  parts[kPartPenetration].add(message.penetration_time);
  parts[kPartMessage].add(message.message_time);
}

}  // namespace ist
