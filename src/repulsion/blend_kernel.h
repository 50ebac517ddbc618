#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "internal/cloud/box_bvh.h"
#include "internal/cloud/thinned_cloud.h"
#include "internal/proximity/deadline.h"
#include "repulsion/coarse_spheres.h"

namespace ist {

/// A link's spheres, posed in the frame O of an index: that of the points, or the map's axes at the
/// boxes' origin. A pair is a sphere and a point, or a sphere and the point of a box
/// that is nearest to it.
struct PosedSpheres {
  const SphereGroup* groups = nullptr;
  std::size_t count = 0;  ///< of groups, no more than kCoarseSpheres fill
  float R_OL[9] = {};     ///< rotation, row-major
  float p_OL[3] = {};     ///< [m] translation
};

/// Sums over pairs, in O; w is a pair's weight, n its unit vector from point to sphere centre.
struct PairSums {
  float weight = 0.0F;
  float force[3] = {};      ///< of w n
  float torque[3] = {};     ///< [m] of a x w n, a from the link's origin to the sphere's centre
  float undirected = 0.0F;  ///< of w where a point is at a centre, so that n is undefined
  float undirected_arm[3] = {};  ///< [m] of w a of those

  void add(const PairSums& other);
};

/// Numbers by sphere, in the order of the groups' slots; in O where they are vectors.
using BySphere = float[kCoarseSpheres];

/// The nearest point of each sphere.
struct alignas(64) NearestPoints {
  BySphere distance;   ///< [m] negative in the sphere; kFarAway where none was found
  BySphere offset[3];  ///< [m] from the point to the sphere's centre
};

/// The sums that a blend is made of, and their slopes as the spheres move. d is a pair's distance,
/// w' the derivative of its weight by d.
struct alignas(64) SphereSums {
  BySphere force[3];  ///< of w n
  BySphere weight;    ///< of w
  // Sums in which the points of a small tile, and neighbours in others, are taken for one in their
  // middle.
  BySphere per_length;    ///< [1/m] of w over the distance from the point to the centre, h
  BySphere outer[6];      ///< [1/m] of (w' - w / h) n n^T: xx, yy, zz, xy, yz, zx
  BySphere slope[3];      ///< [1/m] of w' n
  BySphere weight_slope;  ///< [1/m] of w'
};

/// [m] The smallest distance of a pair, negative where a point is in a sphere; `limit` where no
/// pair is nearer than that. Once the deadline has passed, the result may be too large.
/// @param points  may be null; overwritten with the nearest point of each sphere for which that is
///                no more than `slack` [m] farther than the result
float nearest_pair(const ThinnedCloud& cloud, const PosedSpheres& spheres, float limit,
                   Deadline* deadline, float slack = 0.0F, NearestPoints* points = nullptr);
float nearest_pair(const BoxBvh& index, const PosedSpheres& spheres, float limit,
                   Deadline* deadline);

/// The pairs that count, and how much.
struct Band {
  float nearest;    ///< [m] distance of the nearest pair
  float smoothing;  ///< [m]
};

/// The sums over all pairs nearer than nearest + smoothing; w = (1 - (d - nearest) / smoothing)^2
/// times the points' weight. A tile of points that is small beside its distance from all spheres of
/// a group, and beside the smoothing, enters as its Taylor expansion about the points' weighted
/// mean, to second order. Once the deadline has passed, pairs are missing.
/// @param by_sphere  may be null; overwritten. Slopes are 0 for boxes, which are not known
PairSums blend_pairs(const ThinnedCloud& cloud, const PosedSpheres& spheres, const Band& band,
                     Deadline* deadline, SphereSums* by_sphere = nullptr);
PairSums blend_pairs(const BoxBvh& index, const PosedSpheres& spheres, const Band& band,
                     Deadline* deadline, SphereSums* by_sphere = nullptr);

}  // namespace ist
