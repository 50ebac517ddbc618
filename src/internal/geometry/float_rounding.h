#pragma once

#include <cmath>
#include <limits>

namespace ist {

/// What double loses in a length of some sums and products, in units of the numbers involved: a
/// dozen roundings of 2^-53, and more.
constexpr double kLostInLength = 4e-15;

/// The nearest float that is not below, or not above, the number.
inline float round_up(double value) {
  const auto nearest = static_cast<float>(value);
  return nearest >= value ? nearest : std::nextafter(nearest, std::numeric_limits<float>::max());
}
inline float round_down(double value) { return -round_up(-value); }

}  // namespace ist
