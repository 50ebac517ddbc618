#pragma once

#include <array>
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
  /// Volume of the sphere's power cell over the sphere's own volume; 0 in unused slots.
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
  /// Spheres of different elements may overlap: no point is in more of them.
  double overlap = 1.0;
  /// The greatest cell ratio below each child of the tree's nodes.
  std::vector<std::array<float, kSphereWidth>> greatest_ratio;
};

/// No part of space within a sphere [m] counts for more than its volume times this: the greatest
/// cell ratio of the spheres that intersect it, times how many of them may hold one point; 0 where
/// none does. Groups of spheres that are smaller than that one may count as a whole.
double greatest_density(const ContactSpheres& spheres, const Eigen::Vector3d& center,
                        double radius);

/// Measures the power cells and the outward field of a packing that is there.
/// @param packing  disjoint within each element
ContactGeometry make_contact_geometry(const LinkGeometry& geometry, const Solid& solid,
                                      const Packing& packing);

/// The largest spheres of a packing that do not overlap, `count` at most, the largest first.
Packing disjoint_part(const Packing& packing, std::size_t count);

}  // namespace ist
