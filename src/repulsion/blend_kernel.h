#pragma once

#include <cstddef>
#include <limits>

#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// A link's spheres, posed in the frame O of an index: its origin, and the axes of the fixed frame
/// (points) or the map (boxes). A pair is a sphere and a point, or a sphere and the point of a box
/// that is nearest to it.
struct PosedSpheres {
  const SphereGroup* groups = nullptr;
  std::size_t count = 0;  ///< of groups, no more than kCoarseSpheres fill
  float R_OL[9] = {};     ///< rotation, row-major
  float p_OL[3] = {};     ///< [m] translation
};

/// Sums over pairs of weight w and unit vector n from point to sphere centre, in O.
struct PairSums {
  float weight = 0.0F;
  float force[3] = {};      ///< of w n
  float torque[3] = {};     ///< [m] of a x w n, a from the link's origin to the sphere's centre
  float undirected = 0.0F;  ///< of w where a point is at a centre and there is no n
  float undirected_arm[3] = {};  ///< [m] of w a of those

  void add(const PairSums& other);
};

/// [m] Smallest distance of a pair, negative where a point is in a sphere; `limit` where that is
/// not below it.
float nearest_pair(const PointBvh& index, const PosedSpheres& spheres, float limit);
float nearest_pair(const BoxBvh& index, const PosedSpheres& spheres, float limit);

/// The cells that a cloud was thinned to, as its index's frame sees them.
struct CellGrid {
  /// @param origin  [m] of the index in the fixed frame
  /// @param cell    [m] > 0, edge
  CellGrid(const Eigen::Vector3d& origin, double cell);

  float per_meter;
  float offset[3];  ///< of the origin, in cells
};

/// Which pairs count, and how much.
struct Band {
  float nearest;    ///< [m] distance of the nearest pair
  float smoothing;  ///< [m]
  CellGrid grid;    ///< of the points; boxes have none
};

/// A thinned point stands for what a surface through it has within its cell: with rho its distance
/// from the cell's centre over that of a corner, about (1 - rho^2)^2 of the largest section. So a
/// cell that a surface only just cuts, where it depends on the number of points whether one is in
/// it, counts little. Not nothing, so that every sum of weights is positive.
constexpr float kLeastCellWeight = 0.01F;
constexpr float kCornerSquared = 0.75F;  ///< [cells^2] from a cell's centre

/// Over all pairs nearer than nearest + smoothing, w = (1 - (d - nearest) / smoothing)^2 times the
/// points' weight.
PairSums blend_pairs(const PointBvh& index, const PosedSpheres& spheres, const Band& band);
PairSums blend_pairs(const BoxBvh& index, const PosedSpheres& spheres, const Band& band);

}  // namespace ist
