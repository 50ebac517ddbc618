#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Whether every edge of the mesh has its partner, a triangle's edge passed in the other direction
/// (vertices at the same place count as one).
bool is_closed_mesh(const TriangleMesh& mesh);

/// How many edges of the mesh lack their partner.
std::size_t count_boundary_edges(const TriangleMesh& mesh);

/// An edge whose triangles do not cancel out, in the direction that most of them pass it.
struct OpenEdge {
  std::uint32_t from, to;  ///< vertices; of several at the same place always the same one
  int count;               ///< partners that it lacks, > 0
};

/// All open edges, sorted. At each place as many begin as end: they form closed loops.
std::vector<OpenEdge> open_edges(const TriangleMesh& mesh);

}  // namespace ist
