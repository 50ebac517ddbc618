#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <variant>
#include <vector>

#include "ist_proximity/geometry/triangle_mesh.h"

namespace ist {

/// Axis-aligned box about the origin of its frame.
struct Box {
  Eigen::Vector3d size;  ///< [m] full edge lengths, > 0
};

/// Cylinder about the z axis of its frame, centred at the origin (the URDF convention).
struct Cylinder {
  double radius;  ///< [m] > 0
  double length;  ///< [m] > 0
};

/// InnerSphere about the origin of its frame.
struct Sphere {
  double radius;  ///< [m] > 0
};

using Shape = std::variant<Box, Cylinder, Sphere, TriangleMesh>;

/// One collision (or visual) element of a link: the shape is exactly what the URDF states, a
/// cylinder is a cylinder and not its tessellation.
struct GeometryElement {
  Shape shape;
  Eigen::Isometry3d X_LE = Eigen::Isometry3d::Identity();  ///< element frame E -> link frame L
  std::string source;  ///< for messages: the mesh's URI, or "box", "cylinder", "sphere"
};

/// All elements of a link; the link's solid is their union.
using LinkGeometry = std::vector<GeometryElement>;

}  // namespace ist
