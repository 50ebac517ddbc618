#pragma once

#include <vector>

#include "internal/geometry/boundary_edges.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Triangles that close the holes of a mesh: together with them every edge has its partner, so the
/// winding number of both is an integer off their surfaces, and the mesh's own is that less the
/// caps'. Cracks are closed by narrow triangles: each loop of open edges is cut along its shortest
/// diagonal again and again. Caps may pass through the mesh and each other.
/// @param open  open_edges(mesh)
/// @returns with the vertices of the mesh
TriangleMesh hole_caps(const TriangleMesh& mesh, const std::vector<OpenEdge>& open);

}  // namespace ist
