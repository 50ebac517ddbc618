#include "ros/input/measurement_queue.h"

#include <algorithm>
#include <utility>

#include "ros/common/ros_time.h"

namespace ist {

void MeasurementQueue::clear() {
  waiting_.clear();
  bytes_ = 0;
}

std::size_t MeasurementQueue::add(MeasurementPtr measurement) {
  const ros::Time& stamp = measurement->header.stamp;
  bytes_ += measurement->bytes;
  const auto after = std::upper_bound(waiting_.begin(), waiting_.end(), stamp,
                                      [](const ros::Time& time, const MeasurementPtr& other) {
                                        return time < other->header.stamp;
                                      });
  waiting_.insert(after, std::move(measurement));
  std::size_t dropped = 0;
  for (; waiting_.size() > kMaxCount || (bytes_ > max_bytes_ && waiting_.size() > 1); ++dropped) {
    const std::size_t i = most_crowded();
    erase(i, i + 1);
  }
  return dropped;
}

/// The measurement whose neighbours are nearest to each other in time, the oldest and the newest
/// excepted; of two, the older one.
std::size_t MeasurementQueue::most_crowded() const {
  if (waiting_.size() < 3) return 0;
  const auto gap = [&](std::size_t i) {
    return seconds_between(waiting_[i - 1]->header.stamp, waiting_[i + 1]->header.stamp);
  };
  std::size_t best = 1;
  for (std::size_t i = 2; i + 1 < waiting_.size(); ++i) {
    if (gap(i) < gap(best)) best = i;
  }
  return best;
}

std::size_t MeasurementQueue::drop_overdue(const ros::Time& now, double timeout) {
  const double longest = std::min(timeout, kLongestWait);
  std::size_t overdue = 0;
  while (overdue < waiting_.size() &&
         seconds_between(waiting_[overdue]->counts_from(), now) > longest) {
    ++overdue;
  }
  erase(0, overdue);
  return overdue;
}

void MeasurementQueue::drop_until(std::size_t i) { erase(0, i + 1); }

void MeasurementQueue::erase(std::size_t first, std::size_t last) {
  const auto at = [this](std::size_t i) {
    return waiting_.begin() + static_cast<std::ptrdiff_t>(i);
  };
  for (std::size_t i = first; i < last; ++i) bytes_ -= waiting_[i]->bytes;
  waiting_.erase(at(first), at(last));
}

}  // namespace ist
