#pragma once

#include <cstddef>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// The packing configuration of each element of a link, so that the link as a whole keeps to
/// `config`: elements share max_spheres by surface area (a URDF sphere needs one), at least one
/// each.
std::vector<PackingConfig> element_configs(const LinkGeometry& geometry,
                                           const PackingConfig& config);

/// The same, where the last `attached` elements are attached objects: these take no spheres from
/// their link, so the packings of the link's own elements do not change.
std::vector<PackingConfig> link_configs(const LinkGeometry& geometry, std::size_t attached,
                                        const PackingConfig& config);

/// Combines the packings of a link's elements to one in the link's frame. Spheres are interleaved
/// so that every prefix packs all elements about equally coarsely; each element's largest sphere
/// comes first.
/// @param packings  one per element, in the element's frame
Packing combine(const LinkGeometry& geometry, const std::vector<const Packing*>& packings);

/// The work of packing a shape, relative to others: about its number of triangles.
double packing_work(const Shape& shape);

}  // namespace ist
