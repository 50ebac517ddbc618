#pragma once

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// The triangles that stand for a shape while it is packed.
struct PackedMesh {
  TriangleMesh mesh;
  double deviation = 0.0;  ///< [m] no point of the shape is farther from the mesh's solid
};

/// A mesh itself, the sides of a box, or a prism inscribed in a cylinder. A sphere is packed
/// without triangles and has none here.
PackedMesh packed_mesh(const Shape& shape, const PackingConfig& config);

}  // namespace ist
