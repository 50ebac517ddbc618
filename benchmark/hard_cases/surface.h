#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <random>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

/// Surfaces that clouds are sampled from, and finely triangulated shapes.
namespace ist::benchmark {

/// A point of a surface with the direction in which a sensor's noise moves it.
struct SurfacePoint {
  Eigen::Vector3d p;       ///< [m]
  Eigen::Vector3d normal;  ///< unit; zero: noise has no direction of its own
};

/// A parametrized part of a surface.
struct Patch {
  /// The point at u, v from 0 to 1. Equal areas of (u, v) are equal areas of the surface.
  std::function<SurfacePoint(double u, double v)> at;
  double area;  ///< [m^2]; points are shared out in proportion
};

/// A parallelogram with a corner and two edges [m].
Patch plane_patch(const Eigen::Vector3d& corner, const Eigen::Vector3d& edge_u,
                  const Eigen::Vector3d& edge_v);
/// The lateral surface of a cylinder about z, centred at the origin [m].
Patch tube_patch(double radius, double length);
/// A sphere about the origin [m].
Patch sphere_patch(double radius);
/// One place, over and over.
Patch point_patch(const Eigen::Vector3d& p);
/// Inner sides of a box; without the side at the top (+z) if `open`.
std::vector<Patch> wall_patches(const Eigen::AlignedBox3d& box, bool open);

/// Exactly `count` points of the patches, evenly spread (a low-discrepancy sequence), each moved
/// along its normal by Gaussian noise.
/// @param noise  [m] standard deviation
std::vector<Eigen::Vector3d> sample(const std::vector<Patch>& patches, std::size_t count,
                                    double noise, std::mt19937_64* rng);

/// A box whose faces are divided into squares of at most `edge` [m]. Faces share no vertices.
TriangleMesh divided_box(const Eigen::Vector3d& size, double edge);

/// A corrugated tube about z without thickness, open at both ends: no inner sphere fits into it.
TriangleMesh bellows(double radius, double amplitude, double length, int waves);

}  // namespace ist::benchmark
