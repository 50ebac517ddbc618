#pragma once

#include <cstddef>
#include <cstdint>

#include "internal/cloud/point_bvh.h"

namespace ist {

/// A cubic grid along the fixed frame's axes, as seen from a frame O that lies anywhere in it.
/// Float is enough: cells come out no less exact than the coordinates are.
struct CellGrid {
  float turn[9];    ///< [1/m] rotation from O to the grid's axes over a cell's edge, row-major
  float offset[3];  ///< of O's origin, in cells
};

/// The cells that a tile's points are in.
struct alignas(64) TileCells {
  float x[kPointWidth], y[kPointWidth], z[kPointWidth];  ///< numbers of the cells, whole
  float off_centre[kPointWidth];  ///< squared distance to the cell's centre, in cells
  /// Slots of the points than which none of the tile is nearer to the centre of its cell: one for
  /// each cell, or all that are as near.
  std::uint8_t nearest[kPointWidth];
};

/// Fills in `cells`. @returns how many of `nearest` count
std::size_t find_cells(const CellGrid& grid, const PointTile& tile, TileCells* cells);

}  // namespace ist
