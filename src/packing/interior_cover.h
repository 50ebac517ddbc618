#pragma once

#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/packing/packing.h"
#include "medial_sphere.h"

namespace ist {

/// Extends the cover to the interior: afterwards no point inside the mesh is farther than
/// `interior_gap` from the cover spheres, so that a point farther away is outside for certain.
///
/// An octree over the mesh's box. A cell that the surface crosses is done once its interior points
/// are within the gap wanted of the surface, which is covered: for the size of the cell, or, in
/// closed meshes, after the part below that depth was cut off and found near enough to an outer
/// sphere. An empty cell is outside, or near enough to an cover sphere, or gets a sphere of its
/// own.
/// @param spheres    inner spheres, weighted by inner radius; those added are added here too
/// @param packing  certified by SurfaceCover; spheres are added, `interior_gap` is set to
/// max_error,
///                 or max_gap where that is larger (or more still: where max_spheres leaves
///                 interior cells uncovered)
/// @returns false when `progress` stopped it: nothing is proven then of the interior
bool cover_interior(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                    const PackingConfig& config, const PackingProgress& progress,
                    SphereSearch* spheres, Packing* packing);

}  // namespace ist
