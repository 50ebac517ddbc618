#pragma once

#include <cstddef>

#include "cloud/filters/crop_parameters.h"
#include "cloud/index/near_region.h"
#include "cloud/index/organized_cloud.h"
#include "cloud/index/point_bvh_builder.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Reads an unorganized cloud once, whose points come in any order, and builds its index: drops
/// points that are not finite or not in range and sorts the others into the cells of a grid. Counts
/// `not_a_number`, `infinite`, `outside_region` and `in_zones`.
/// @param filters  without a view filter
/// @param region  where points are sliced into small tiles, begun with the links of the
///                self-filter; null: everywhere
/// @param bvh  overwritten, its buffers reused
/// @returns how many points are kept, before the filters drop some
std::size_t index_unorganized(const RawCloud& cloud, const CropParameters& crop,
                              const CloudFilters& filters, NearRegion* region,
                              PointBvhBuilder* builder, PointBvh* bvh, IngestCounts* counts);

}  // namespace ist
