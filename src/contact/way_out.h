#pragma once

#include <Eigen/Core>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// The direction in which a point inside a link gets out, as a smooth field: see ContactBody.
class WayOut {
 public:
  /// Samples the surface; what lies inside another element of the link is left out.
  WayOut(const LinkGeometry& geometry, const Solid& solid);

  /// At p_L: of length up to 1.5, about 1 near a flat surface.
  Eigen::Vector3d operator()(const Eigen::Vector3d& p_L) const;

  /// Its derivative about a sphere's centre [1/m], by differences across half the sphere.
  Eigen::Matrix3d slope(const Eigen::Vector3d& center, double radius) const;

 private:
  void add(const TriangleMesh& mesh, const Eigen::Isometry3d& X_LE);

  double spacing_ = 0.0;  ///< [m] of the samples, about
  std::vector<float> x_, y_, z_, area_;
};

}  // namespace ist
