#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// The exact signed distance from a point to a solid.
struct SignedDistance {
  double distance = std::numeric_limits<double>::infinity();  ///< [m] negative inside
  Eigen::Vector3d witness = Eigen::Vector3d::Zero();  ///< [m] closest surface point, query frame
  /// The gradient of the distance: unit vector in the query frame along which the point moves away
  /// from the solid, or out of it. Defined at distance 0 too.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

struct SolidElement;

/// The exact geometry of one link: the union of its elements. Primitives are evaluated in closed
/// form, meshes through a bounding volume hierarchy in double precision.
///
/// A point outside has the distance to the nearest element. A point inside has minus its depth in
/// the element that holds it deepest; each element's depth is measured to its own surface. The
/// inside of a mesh is where its generalized winding number exceeds 0.5 (Jacobson et al. 2013),
/// within the mesh's axis-aligned bounding box: next to surfaces that lie double, the number alone
/// may exceed 0.5 outside of it.
/// Immutable, cheap to copy (copies share the elements); const members are thread safe and allocate
/// nothing.
class Solid {
 public:
  Solid() = default;
  /// The union of the elements of a link. Builds a hierarchy for each mesh.
  /// @throws ModelError when a size, a corner or a position is not finite, or larger than 10 km
  explicit Solid(const LinkGeometry& geometry);

  /// Signed distance of a point.
  /// @param p_L  [m] link frame
  /// @returns witness and normal in the link frame; distance = inf for an empty solid
  SignedDistance signed_distance(const Eigen::Vector3d& p_L) const;

  /// Whether p_L [m] (link frame) is inside any element.
  bool is_inside(const Eigen::Vector3d& p_L) const;

  /// Whether every element is a primitive or a closed mesh. The inside of a mesh with holes ends
  /// in the holes too, not at its surface alone.
  bool is_closed() const;

  /// Whether it has no elements.
  bool empty() const;
  /// Triangles of all meshes; primitives have none.
  std::size_t triangle_count() const;

 private:
  /// The library's own queries (distance to a box, penetration depth, support) read the elements.
  friend const std::vector<SolidElement>& elements_of(const Solid& solid);
  friend Solid make_solid(const LinkGeometry& geometry, const std::function<bool()>& cancelled);

  std::shared_ptr<const std::vector<SolidElement>> elements_;  // null: none
};

}  // namespace ist
