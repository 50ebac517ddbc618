#pragma once

#include <vector>

#include "internal/geometry/boundary_edges.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Triangles that close the holes of a mesh. Every edge of mesh and caps together has a partner, so
/// that their common winding number is an integer off their surfaces; the mesh's own winding number
/// is that integer minus the one of the caps. Each loop of open edges is triangulated by cutting
/// along its shortest diagonal repeatedly, which closes cracks by narrow triangles. Caps may
/// intersect the mesh and each other.
/// @param open  open_edges(mesh)
/// @returns with the vertices of the mesh
/// @throws Cancelled when the request says so
TriangleMesh hole_caps(const TriangleMesh& mesh, const std::vector<OpenEdge>& open,
                       const CancelRequest& cancelled = {});

}  // namespace ist
