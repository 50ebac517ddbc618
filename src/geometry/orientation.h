#pragma once

#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Flips the triangles of closed surfaces that are inside out, which would have no inside
/// otherwise.
///
/// The mesh as a whole is flipped first, then each shell (triangles that share vertices) that lies
/// in no other shell. Shells within a flipped shell are flipped too, so that cavities stay
/// cavities. Open meshes and shells, whose volume has no certain sign, stay as they are, and so do
/// shells with inconsistent orientation and meshes of many thousand shells.
/// @param mesh  vertices at the same place are one vertex, as load_mesh makes them
/// @throws Cancelled; the mesh is as it was then, or every triangle is flipped
void orient_outward(TriangleMesh* mesh, const CancelRequest& cancelled = {});

}  // namespace ist
