#pragma once

namespace ist {

/// Farther points are out of range whatever the configuration: no sensor sees as far. Keeps
/// coordinates far below kFarAway. [m]
constexpr double kLargestRange = 1e9;

}  // namespace ist
