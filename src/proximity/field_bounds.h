#pragma once

#include "proximity/link_bounds.h"

namespace ist {

/// These functions do what LinkBounds does where the link has a field.
float bound_boxes_by_field(const PlacedLink& link, const BoxRows& boxes,
                           const SearchQueue::Entry& parent, const Corners* corners,
                           Bounds* bounds);
float bound_points_by_field(const PlacedLink& link, const PointTile& tile,
                            const SearchQueue::Entry& box, Bounds* bounds);
void bound_corners_by_field(const PlacedLink& link, const SearchQueue::Entry& box,
                            Corners* corners);

}  // namespace ist
