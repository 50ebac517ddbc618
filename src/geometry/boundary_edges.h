#pragma once

#include <cstddef>

#include "ist_proximity/geometry/triangle_mesh.h"

namespace ist {

/// Whether every edge of the mesh is shared by exactly two triangles of opposite direction
/// (vertices at the same place count as one).
bool is_closed_mesh(const TriangleMesh& mesh);

/// How many edges of the mesh lack their partner.
std::size_t count_boundary_edges(const TriangleMesh& mesh);

}  // namespace ist
