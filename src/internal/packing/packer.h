#pragma once

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

struct MeshSurface;

/// Part of every cache key. Raise it whenever the same shape and configuration pack differently.
constexpr int kPackingVersion = 4;

/// Packs a mesh with inner spheres, in the order of `config.order`, until the certified gap of
/// every surface patch and of the interior is at most `config.max_error`.
///
/// The distance to a sphere is convex, so over a triangle it is largest at a corner: this is the
/// upper bound of a patch's gap. Branch and bound takes the patch with the largest upper bound, and
/// splits it or adds a medial sphere that touches it. Where no sphere fits (open sheets, flaps),
/// spheres of radius 0 on the surface take over, so any mesh can be covered. Deterministic and
/// thread safe.
///
/// In disjoint packings no two inner spheres overlap, including those that cover the interior;
/// their cover spheres do overlap.
/// @param progress  may be empty
/// @param surface   of the mesh, where it is known already; else null
/// @throws ModelError if the mesh has no triangle, or a triangle with a corner that is not finite
/// or
///         does not exist
Packing pack_mesh(const TriangleMesh& mesh, const PackingConfig& config,
                  const PackingProgress& progress = {}, const MeshSurface* surface = nullptr);

/// Packs one URDF element, in the element's frame. A sphere is packed by itself, without gap. Boxes
/// and cylinders are packed through an inscribed mesh whose deviation is added to every gap.
/// Otherwise as pack_mesh().
/// @param surface  of a mesh, where it is known already; else null
Packing pack_element(const Shape& shape, const PackingConfig& config,
                     const PackingProgress& progress = {}, const MeshSurface* surface = nullptr);

}  // namespace ist
