#pragma once

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// A closed mesh inscribed in a primitive, and the distance between the two.
struct Tessellation {
  TriangleMesh mesh;       ///< every triangle lies inside or on the primitive
  double deviation = 0.0;  ///< [m] largest distance from a point of the primitive to the mesh
};

/// The 12 triangles of a box; deviation 0.
Tessellation tessellate(const Box& box);

/// An inscribed prism with as many sides as `max_deviation` [m] asks for (8 to 512), its lateral
/// faces divided along the axis so that no triangle is a needle.
Tessellation tessellate(const Cylinder& cylinder, double max_deviation);

/// An inscribed icosphere of at most `max_deviation` [m] (capped at 5 subdivisions).
Tessellation tessellate(const Sphere& sphere, double max_deviation);

/// The triangles of any shape: a mesh's own, or those of the meshes above, which are off by at most
/// a share of the primitive's radius.
TriangleMesh mesh_of(const Shape& shape, double share);

}  // namespace ist
