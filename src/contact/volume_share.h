#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// What each sphere stands for.
struct VolumeShares {
  std::vector<double> share;   ///< by sphere: the volume it stands for, in volumes of its own
  double volume = 0.0;         ///< [m^3] that all stand for
  double packed_volume = 0.0;  ///< [m^3] of the spheres alone
};

/// Divides a link's volume among its spheres. A void goes to the sphere of least power |p - c|^2 -
/// r^2; voids are measured on a grid of 60000 cells in the link's box, of which those at a surface
/// count in part: good to about a percent for the whole link. Where spheres of different elements
/// overlap, each keeps the share w = V / sum(lens) of its own volume: together no more than their
/// union, since the mean of 1/n is at least 1 over the mean of n.
/// @param spheres  with radius > 0, at least one
/// @param box    about the link, its frame
VolumeShares volume_shares(const std::vector<InnerSphere>& spheres, const Eigen::AlignedBox3d& box,
                           const Solid& solid);

}  // namespace ist
