#pragma once

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Turns what is closed and inside out, so that outside is outside: taken at its word, it would
/// have no inside.
///
/// First the mesh as a whole, then each shell (triangles that share vertices) that lies in no other
/// one; what lies within a shell is turned with it, so that cavities stay cavities. Open meshes and
/// shells, where outside cannot be told like this, are left alone, as are those whose faces are
/// turned here and there. (So are the shells of meshes that have many thousands of them.)
/// @param mesh  vertices at the same place are one vertex, as load_mesh makes them
void turn_outward(TriangleMesh* mesh);

}  // namespace ist
