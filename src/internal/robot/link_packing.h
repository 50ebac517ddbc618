#pragma once

#include <cstddef>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// How each element of a link is packed, so that the link as a whole keeps to `config`: max_spheres
/// is shared by surface area (a URDF sphere needs one), at least one each.
std::vector<PackingConfig> element_configs(const LinkGeometry& geometry,
                                           const PackingConfig& config);

/// As element_configs, where the last `attached` elements are attached objects: these take no
/// spheres from their link, whose packings so stay as they are.
std::vector<PackingConfig> link_configs(const LinkGeometry& geometry, std::size_t attached,
                                        const PackingConfig& config);

/// The packings of a link's elements as one, in the link's frame. Spheres are interleaved so that
/// every prefix packs all elements about equally coarsely; each element's largest sphere comes
/// first.
/// @param packings  one per element, in the element's frame
Packing combine(const LinkGeometry& geometry, const std::vector<const Packing*>& packings);

/// How much work packing a shape is, relative to others: its number of triangles, about.
double packing_work(const Shape& shape);

}  // namespace ist
