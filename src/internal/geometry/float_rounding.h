#pragma once

#include <cmath>
#include <limits>

namespace ist {

/// The rounding error of a length in double, relative to the numbers that it is computed from: more
/// than a dozen roundings of 2^-53.
constexpr double kLostInLength = 4e-15;

/// The nearest float that is not below (round_up) or not above (round_down) the number.
inline float round_up(double value) {
  const auto nearest = static_cast<float>(value);
  return nearest >= value ? nearest : std::nextafter(nearest, std::numeric_limits<float>::max());
}
inline float round_down(double value) { return -round_up(-value); }

}  // namespace ist
