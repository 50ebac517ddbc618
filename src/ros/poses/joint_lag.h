#pragma once

namespace ist {

/// A joint that is stated apart is held at its last sample until that is older than other joints by
/// more than so many of its intervals and this time [s]. Publishers on one machine may be so late.
/// Poses are older than header.stamp says by what is allowed here.
constexpr int kHeldIntervals = 2;
constexpr double kLag = 0.05;

}  // namespace ist
