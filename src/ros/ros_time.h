#pragma once

#include <ros/time.h>

#include <cstdint>

namespace ist {

/// end - begin [s], for any two stamps: the difference of ros::Time throws when it is more than 68
/// years, which a stamp in somebody's message can be.
inline double seconds_between(const ros::Time& begin, const ros::Time& end) {
  const auto difference =
      static_cast<std::int64_t>(end.toNSec()) - static_cast<std::int64_t>(begin.toNSec());
  return 1e-9 * static_cast<double>(difference);
}

}  // namespace ist
