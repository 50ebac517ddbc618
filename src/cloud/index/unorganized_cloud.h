#pragma once

#include <cstddef>

#include "cloud/filters/crop_parameters.h"
#include "cloud/filters/self_filter.h"
#include "cloud/index/near_region.h"
#include "cloud/index/point_bvh_builder.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Reads an unorganized cloud once, whose points come in any order, and builds its index: drops
/// points that are not finite or not in range and sorts the others into the cells of a grid. Counts
/// `not_a_number`, `infinite` and `outside_region`.
/// @param on_robot  null: no self-filter
/// @param region  where points are sliced into small tiles, begun with the links of `on_robot`;
/// null:
///                everywhere
/// @param bvh  overwritten, its buffers reused
/// @returns how many points are kept, before `on_robot` drops some
std::size_t index_unorganized(const RawCloud& cloud, const CropParameters& crop,
                              SelfFilter* on_robot, NearRegion* region, PointBvhBuilder* builder,
                              PointBvh* bvh, IngestCounts* counts);

}  // namespace ist
