#pragma once

#include <ros/time.h>

#include <cstdint>

namespace ist {

/// The difference end - begin [s] of any two stamps. The difference of ros::Time throws when it is
/// more than 68 years, and a stamp in a message may be that far away.
inline double seconds_between(const ros::Time& begin, const ros::Time& end) {
  const auto difference =
      static_cast<std::int64_t>(end.toNSec()) - static_cast<std::int64_t>(begin.toNSec());
  return 1e-9 * static_cast<double>(difference);
}

}  // namespace ist
