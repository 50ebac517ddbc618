#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Whether the mesh is closed: every edge of a triangle has a partner, the same edge of another
/// triangle in the opposite direction. Vertices at the same place count as one.
/// @throws Cancelled
bool is_closed_mesh(const TriangleMesh& mesh, const CancelRequest& cancelled = {});

/// The number of edges without a partner.
std::size_t count_boundary_edges(const TriangleMesh& mesh);

/// A boundary edge, in the direction in which more triangles use it than in the other one.
struct OpenEdge {
  std::uint32_t from, to;  ///< vertices; one vertex represents all at the same place
  int count;               ///< missing partners, > 0
};

/// All boundary edges, sorted. As many begin as end at each vertex, so that they form closed loops.
/// Half a second for a mesh of a million triangles.
/// @throws Cancelled
std::vector<OpenEdge> open_edges(const TriangleMesh& mesh, const CancelRequest& cancelled = {});

}  // namespace ist
