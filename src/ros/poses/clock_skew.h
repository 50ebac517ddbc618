#pragma once

namespace ist {

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
