#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// The cells of the spheres' power diagram within a link: a void goes to the sphere of least power
/// |p - c|^2 - r^2, so that the spheres together stand for the link's whole volume.
///
/// Voids are measured on a grid of 60000 cells in the link's box, of which those at a surface count
/// in part: good to about a percent for the whole link. Where spheres of different elements
/// overlap, each counts with the part of it that is in its power cell, by the same grid: together
/// they count as their union.
struct PowerCells {
  /// @param spheres  with radius > 0, at least one
  /// @param box      about the link, its frame
  PowerCells(const std::vector<InnerSphere>& spheres, const Eigen::AlignedBox3d& box,
             const Solid& solid);

  std::vector<double> ratio;   ///< by sphere: volume of its cell over its own volume
  double volume = 0.0;         ///< [m^3] of all cells
  double packed_volume = 0.0;  ///< [m^3] of the spheres alone
};

}  // namespace ist
