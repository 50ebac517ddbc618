#pragma once

#include <cstdint>
#include <cstring>

namespace ist {

/// The rounding error of a length in double, relative to the numbers that it is computed from: more
/// than a dozen roundings of 2^-53.
constexpr double kLostInLength = 4e-15;

/// The nearest float that is not below (round_up) or not above (round_down) the number. Bounds are
/// stored by the thousand in a query, so that a call of std::nextafter() for each would be felt.
inline float round_up(double value) {
  auto rounded = static_cast<float>(value);
  if (!(rounded < value)) return rounded;  // or NaN
  std::uint32_t bits;
  std::memcpy(&bits, &rounded, sizeof bits);
  bits += rounded < 0.0F ? 0xFFFFFFFFU : 1U;  // floats of one sign are in the order of their bits
  std::memcpy(&rounded, &bits, sizeof bits);
  return rounded;
}
inline float round_down(double value) { return -round_up(-value); }

}  // namespace ist
