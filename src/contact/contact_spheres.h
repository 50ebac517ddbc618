#pragma once

#include <vector>

#include "contact/volume_elements.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/packing/packing.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Up to eight spheres of a disjoint packing, side by side for SIMD, in the link's frame.
struct alignas(32) ContactLeaf {
  float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth];  ///< [m] centres
  float radius[kSphereWidth];                               ///< [m] negative in unused slots
  /// Volume of the sphere's power cell over the sphere's own volume; >= 1, 0 in unused slots.
  float cell_ratio[kSphereWidth];
  float outward[3][kSphereWidth];   ///< outward field at the centre, see ContactGeometry
  float gradient[9][kSphereWidth];  ///< [1/m] of the outward field, row-major
};

/// The pieces that a link's contact volumes are summed over: spheres against clouds and maps,
/// elements against other links.
struct ContactSpheres {
  InnerSphereTree tree;             ///< over the spheres that have a volume
  std::vector<ContactLeaf> leaves;  ///< the same leaves as the tree's
  VolumeElements elements;
  Solid solid;  ///< the link's exact geometry
};

/// Measures the power cells and the outward field of a packing that is there.
/// @param packing  disjoint within each element
ContactGeometry make_contact_geometry(const LinkGeometry& geometry, const Solid& solid,
                                      const Packing& packing);

/// The largest spheres of a packing that do not overlap, `count` at most, the largest first.
Packing disjoint_part(const Packing& packing, std::size_t count);

}  // namespace ist
