#pragma once

#include <ros/time.h>

#include <cstddef>
#include <deque>
#include <memory>

#include "ros/input/measurement.h"

namespace ist {

/// Measurements that wait for their transforms, ordered by stamp. Time and memory bound it: no
/// number does, since transforms that are late by a second make 30 clouds wait at 30 Hz. Not thread
/// safe.
class MeasurementQueue {
 public:
  using MeasurementPtr = std::shared_ptr<const Measurement>;

  /// [s] A measurement waits no longer than tf keeps transforms.
  static constexpr double kLongestWait = 10.0;
  /// One second of a camera of 640 x 480 points of 32 bytes at 30 Hz is 300 MB.
  static constexpr std::size_t kMaxBytes = std::size_t{300} << 20;
  /// Scans of some kB at 100 Hz wait for kLongestWait.
  static constexpr std::size_t kMaxCount = 1000;

  explicit MeasurementQueue(std::size_t max_bytes = kMaxBytes) : max_bytes_(max_bytes) {}

  bool empty() const { return waiting_.empty(); }
  std::size_t size() const { return waiting_.size(); }
  const Measurement& operator[](std::size_t i) const { return *waiting_[i]; }
  const Measurement& newest() const { return *waiting_.back(); }
  void clear();

  /// Adds a measurement. Where the queue is full, those go whose neighbours are nearest in time, so
  /// that the others cover all of the wait and the oldest, which is ready first, stays.
  /// @returns how many went
  std::size_t add(MeasurementPtr measurement);

  /// Drops measurements that have waited longer than `timeout` or kLongestWait.
  /// @param now  the ROS clock's time
  /// @returns how many
  std::size_t drop_overdue(const ros::Time& now, double timeout);

  /// Drops measurement `i` and the older ones.
  void drop_until(std::size_t i);

  /// The newest measurement for which `is_ready` holds; size() where there is none. Transforms come
  /// in order, so it asks about few: those that are 1, 2, 4, ... from the newest, then by
  /// bisection.
  template <typename Ready>
  std::size_t newest_ready(const Ready& is_ready) const {
    std::size_t not_ready = size();
    for (std::size_t step = 1; not_ready > 0; step *= 2) {
      std::size_t ready = not_ready > step ? not_ready - step : 0;
      if (!is_ready(*waiting_[ready])) {
        not_ready = ready;
        continue;
      }
      while (not_ready - ready > 1) {
        const std::size_t middle = ready + (not_ready - ready) / 2;
        (is_ready(*waiting_[middle]) ? ready : not_ready) = middle;
      }
      return ready;
    }
    return size();
  }

 private:
  std::size_t most_crowded() const;
  void erase(std::size_t first, std::size_t last);

  const std::size_t max_bytes_;
  std::size_t bytes_ = 0;
  std::deque<MeasurementPtr> waiting_;
};

}  // namespace ist
