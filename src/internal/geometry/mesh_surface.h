#pragma once

#include <vector>

#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/triangle_bvh.h"

namespace ist {

/// What packing and its check read of a mesh's surface. Queries of the same mesh have it, too, so
/// that it is built once for both.
struct MeshSurface {
  const TriangleBvh& bvh;
  const std::vector<OpenEdge>& open_edges;  ///< open_edges(mesh)
};

}  // namespace ist
