#pragma once

namespace ist {

/// Points farther from the sensor are out of range whatever the configuration, and a sensor farther
/// from the fixed frame's origin is refused: it is 70 times the Earth's diameter. Squares of such
/// coordinates are finite in float, and far below kFarAway. [m]
constexpr double kLargestRange = 1e9;

}  // namespace ist
