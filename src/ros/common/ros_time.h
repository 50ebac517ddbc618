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

// Stamps that are ahead of the clock.

/// Data stamped farther ahead are refused [s]. Some publishers stamp fixed joints half a second
/// ahead.
constexpr double kMaxAhead = 1.0;
/// A clock that is ahead by this is told [s].
constexpr double kToldSkew = 0.05;
/// Joint states that are ahead by less are taken as stamped [s]: clocks that are well synchronized,
/// and simulated ones, differ by this.
constexpr double kClockResolution = 0.01;

}  // namespace ist
