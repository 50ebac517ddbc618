#pragma once

#include <vector>

#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// What each ball stands for.
struct VolumeShares {
  std::vector<double> share;   ///< by ball: the volume it stands for, in volumes of its own
  double volume = 0.0;         ///< [m^3] that all stand for
  double packed_volume = 0.0;  ///< [m^3] of the balls alone
};

/// Divides a link's volume among its balls. A void goes to the ball of least power |p - c|^2 - r^2;
/// voids are measured by counting the points of a grid, kGridPoints in the balls' box, so that one
/// ball's share is off by the square root of its count, and all of them by a percent or less. Where
/// balls of different elements overlap, each keeps the share w = V / sum(lens) of its own volume:
/// together no more than their union, since the mean of 1/n is at least 1 over the mean of n.
/// @param balls  with radius > 0, at least one
VolumeShares volume_shares(const std::vector<Ball>& balls, const Solid& solid);

}  // namespace ist
