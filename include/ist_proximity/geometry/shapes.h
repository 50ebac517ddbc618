#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace ist {

/// Indexed triangles in the frame M of the mesh, in metres. Corners are counter-clockwise as seen
/// from outside. The mesh need not be closed, manifold or consistently oriented: its inside is
/// where its generalized winding number exceeds 0.5.
struct TriangleMesh {
  /// Indices of the corners in `vertices`.
  using Triangle = std::array<std::uint32_t, 3>;

  std::vector<Eigen::Vector3d> vertices;  ///< [m] in M
  std::vector<Triangle> triangles;        ///< each names three vertices

  /// Corner k (0, 1 or 2) of a triangle [m] in M.
  const Eigen::Vector3d& corner(std::size_t triangle, int k) const {
    return vertices[triangles[triangle][static_cast<std::size_t>(k)]];
  }
};

/// Axis-aligned box about the origin of its frame.
struct Box {
  Eigen::Vector3d size;  ///< [m] full edge lengths, > 0
};

/// Cylinder about the z axis of its frame, centred at the origin (the URDF convention).
struct Cylinder {
  double radius;  ///< [m] > 0
  double length;  ///< [m] > 0
};

/// Sphere about the origin of its frame.
struct Sphere {
  double radius;  ///< [m] > 0
};

/// The shape of a geometry element, in the element's frame E.
using Shape = std::variant<Box, Cylinder, Sphere, TriangleMesh>;

/// One collision (or visual) element of a link. The shape is exactly what the URDF states: a
/// cylinder is a cylinder, not its tessellation.
struct GeometryElement {
  Shape shape;                                             ///< in E
  Eigen::Isometry3d X_LE = Eigen::Isometry3d::Identity();  ///< element frame E -> link frame L
  std::string source;  ///< for messages: the mesh's URI, or "box", "cylinder", "sphere"
};

/// All elements of a link; the link's solid is their union.
using LinkGeometry = std::vector<GeometryElement>;

}  // namespace ist
