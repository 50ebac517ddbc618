#pragma once

#include <Eigen/Core>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// The outward field of a link (see ContactGeometry): a smooth vector field that points from the
/// inside to the nearest surface.
class OutwardField {
 public:
  /// Samples the surface; the parts inside another element of the link are left out.
  OutwardField(const LinkGeometry& geometry, const Solid& solid);

  /// The field at p_L [m]: of length up to 1.5, about 1 near a flat surface.
  Eigen::Vector3d at(const Eigen::Vector3d& p_L) const;

  /// The field's gradient [1/m] at a sphere's centre, by differences across half the sphere.
  Eigen::Matrix3d gradient(const Eigen::Vector3d& center, double radius) const;

 private:
  void add(const TriangleMesh& mesh, const Eigen::Isometry3d& X_LE);

  double spacing_ = 0.0;  ///< [m] of the samples, about
  /// Samples: position [m], and area over spacing_^2.
  std::vector<float> x_, y_, z_, area_;
};

}  // namespace ist
