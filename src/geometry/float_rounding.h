#pragma once

#include <cmath>
#include <limits>

namespace ist {

/// The nearest float that is not below, or not above, the number.
inline float round_up(double value) {
  const auto nearest = static_cast<float>(value);
  return nearest >= value ? nearest : std::nextafter(nearest, std::numeric_limits<float>::max());
}
inline float round_down(double value) { return -round_up(-value); }

}  // namespace ist
