#pragma once

#include <string>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// Proves that a packing from outside is one of this shape: a file of the cache may be forged or
/// damaged in ways that no checksum shows.
///
/// - Its spheres are at most `config.max_spheres`.
/// - No inner sphere reaches out of the shape: its centre is inside, and no nearer to the surface
///   than its radius. In orders without overlap no two overlap.
/// - The cover spheres cover the surface. A triangle is covered by a sphere that contains its
///   corners; else it is halved, as the packer halves it.
/// - No interior point is farther than the interior gap from the cover spheres. The octree of
///   cover_interior() shows it, without adding spheres.
/// - The certificate says what follows from spheres and surface.
///
/// Near the holes of a mesh, the inner spheres are proven to touch no triangle, not to keep away
/// from the opening. Takes about a tenth of the time of packing. Thread safe.
/// @param progress  as for pack_element()
/// @returns an empty string, or what is wrong, as "its sphere 7 reaches 3 mm out of the shape";
/// also
///          when `progress` ended it
std::string packing_fault(const Shape& shape, const PackingConfig& config, const Packing& packing,
                          const PackingProgress& progress = {});

/// [m] A gap that is proven as PackingCertificate::interior_gap is, and mostly smaller: packing
/// aims at no smaller one than the surface's. Tries halves of the certificate's, and takes as long
/// as packing. Thread safe.
/// @param packing  covers the shape's surface; spheres of other shapes may be among it
double tight_interior_gap(const Shape& shape, const PackingConfig& config, const Packing& packing);

}  // namespace ist
