#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "geometry/open_edge_hierarchy.h"
#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// One element of a solid, as queries need it.
struct SolidElement {
  /// @throws Cancelled
  SolidElement(const GeometryElement& source, const CancelRequest& cancelled);

  bool is_mesh() const { return bvh.size() > 0; }

  /// Whether p_E [m] (element frame) is inside.
  bool is_inside(const Eigen::Vector3d& p_E) const;

  /// Signed distance from the closest point of the mesh, in the element frame.
  SignedDistance signed_distance(const Eigen::Vector3d& p_E, const ClosestPoint& closest,
                                 bool inside) const;

  Shape primitive;        ///< Box, Cylinder or Sphere; an empty mesh when `bvh` is used
  TriangleBvh box_sides;  ///< of a Box
  TriangleBvh bvh;
  std::vector<Eigen::Vector3d> normals;  ///< unit, by triangle; zero for triangles without area
  std::vector<OpenEdge> boundary;        ///< of a mesh with holes: open_edges(mesh)
  OpenEdgeHierarchy open_edges;          ///< the same edges
  Eigen::Isometry3d X_LE;
  Eigen::Isometry3d X_EL;
  bool is_closed = true;  ///< a primitive, or a mesh without holes
};

inline const std::vector<SolidElement>& elements_of(const Solid& solid) {
  static const std::vector<SolidElement> kNone;
  return solid.elements_ != nullptr ? *solid.elements_ : kNone;
}

/// The same signed distance in the link's frame.
SignedDistance to_link_frame(const SolidElement& element, const SignedDistance& in_E);

}  // namespace ist
