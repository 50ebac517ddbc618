#pragma once

#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/packing/packing.h"
#include "medial_sphere.h"
#include "packing_watch.h"

namespace ist {

/// Extends the cover to the interior: afterwards no point inside the mesh is farther than
/// `interior_gap` from the cover spheres, so a point farther away is certainly outside.
///
/// An octree over the mesh's box. A cell that the surface crosses is covered if all its interior
/// points are within the wanted gap of the surface, which is covered itself: because the cell is
/// small, or, in closed meshes, because the part below that depth was clipped off and lies near
/// enough to a cover sphere. A cell that the surface does not cross is outside, or near enough to a
/// cover sphere, or gets a sphere of its own. All other cells are divided.
/// @param spheres  inner spheres, weighted by inner radius; new ones are added here, too
/// @param packing  certified by SurfaceCover; spheres are added. `interior_gap` becomes max_error,
///                 or max_gap where that is larger, or more still where max_spheres leaves cells
///                 uncovered
/// @returns false when `watch` stopped it: nothing is proven of the interior then
bool cover_interior(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                    const PackingConfig& config, PackingWatch* watch, SphereSearch* spheres,
                    Packing* packing);

/// Whether no point inside the mesh is farther than `gap` [m] from the cover spheres, shown by the
/// same octree. A packing whose `interior_gap` is from cover_interior() passes. False also when the
/// search takes too long, or `watch` stops it.
/// @param deviation  [m] taken off every cover radius
bool is_interior_covered(const TriangleMesh& mesh, const TriangleBvh& bvh, const Packing& packing,
                         double deviation, double gap, PackingWatch* watch);

}  // namespace ist
