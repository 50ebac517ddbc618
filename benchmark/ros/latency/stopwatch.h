#pragma once

#include <ros/time.h>

#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "support.h"

namespace ist::benchmark {

/// Measures the time from sending a message to its answer, by stamp. Thread safe.
class Stopwatch {
 public:
  void sent(const ros::Time& stamp) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (counting_) sent_[stamp.toNSec()] = Clock::now();
  }
  /// The first answer counts.
  void answered(const ros::Time& stamp) {
    const Clock::time_point now = Clock::now();
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = sent_.find(stamp.toNSec());
    if (found == sent_.end()) return;
    const std::chrono::duration<double, std::milli> took = now - found->second;
    took_.push_back(took.count());
    sent_.erase(found);
  }
  void count(bool counting) {
    const std::lock_guard<std::mutex> lock(mutex_);
    counting_ = counting;
  }
  double share_answered() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto all = static_cast<double>(took_.size() + sent_.size());
    return all > 0.0 ? static_cast<double>(took_.size()) / all : 0.0;
  }
  /// [ms]
  double took(double q) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return quantile(took_, q);
  }

 private:
  std::mutex mutex_;
  bool counting_ = false;
  std::map<std::uint64_t, Clock::time_point> sent_;
  std::vector<double> took_;  ///< [ms]
};

}  // namespace ist::benchmark
