#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "support/link_pair_oracle.h"

/// Brute force for the distance of a link and an object: every element against every element, every
/// triangle against every triangle. It shares no code with the library.
namespace ist::test {

/// An element of a link or an object: triangles, a sphere, or a cylinder; a box is 12 triangles.
class OracleElement {
 public:
  explicit OracleElement(const GeometryElement& element);

  const Eigen::Vector3d& center() const { return center_; }
  double radius() const { return radius_; }

  /// [m] The distance; 0 or less where the surfaces intersect, or a sphere or cylinder holds a
  /// point of the other one. @param X  the other one's frame -> this one's
  double distance(const OracleElement& other, const Eigen::Isometry3d& X) const;

 private:
  double signed_distance(const Eigen::Vector3d& p_L) const;

  // Triangles against a sphere or cylinder, whose signed distance is convex.
  double to_round(const OracleElement& round, const Eigen::Isometry3d& X) const;

  // The point of the solid that is nearest to p_L.
  Eigen::Vector3d nearest(const Eigen::Vector3d& p_L) const;

  // Alternating projections of two convex bodies.
  double round_to_round(const OracleElement& other, const Eigen::Isometry3d& X) const;

  GeometryElement element_;
  std::vector<Corners3<double>> triangles_;
  TriangleGroups groups_;
  Eigen::Vector3d center_;
  double radius_;
};

/// A link or object.
class OracleSolid {
 public:
  explicit OracleSolid(const LinkGeometry& geometry);

  /// [m] The distance, where it is less than `enough`; 0 or less in contact.
  /// @param X  the other one's frame -> this one's
  double distance(const OracleSolid& other, const Eigen::Isometry3d& X, double enough) const;

 private:
  // Whether a corner or centre of the other one is inside.
  bool holds(const OracleSolid& other, const Eigen::Isometry3d& X) const;

  LinkGeometry geometry_;
  std::vector<OracleElement> elements_;
  std::vector<Eigen::Vector3d> points_;
};

}  // namespace ist::test
