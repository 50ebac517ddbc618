#pragma once

#include <vector>

#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/triangle_bvh.h"

namespace ist {

/// The hierarchy and the boundary edges of a mesh, which packing reads. Queries of the same mesh
/// have them, too, so that they are built once for both.
struct MeshSurface {
  const TriangleBvh& bvh;
  const std::vector<OpenEdge>& open_edges;  ///< open_edges(mesh)
};

}  // namespace ist
