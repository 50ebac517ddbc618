#pragma once

#include <cstddef>

#include "cloud/filters/crop.h"
#include "cloud/filters/self_filter.h"
#include "cloud/filters/view_filter.h"
#include "cloud/index/point_bvh_builder.h"

namespace ist {

/// Whether a cloud is organized: an image of surfaces, in which neighbouring pixels are neighbours
/// in space. Samples some blocks of pixels; the answer decides how fast the cloud is indexed, not
/// what is found.
bool is_organized(const RawCloud& cloud, const CropParameters& crop);

/// Reads an organized cloud once and builds its index without sorting points: squares of 4 x 4
/// pixels become tiles, squares of 4 x 4 tiles become nodes. At depth discontinuities a tile is
/// split, and tiles that no longer fill a node are grouped by where they are. Counts
/// `not_a_number`, `infinite` and `outside_region`.
/// @param on_robot  null: no self-filter
/// @param view      null: the self-filter drops all that is within its padding; else only what the
///                  view filter, which look_at_robot() has shown the cloud, takes for the robot
/// @param bvh  overwritten, its buffers reused
/// @returns how many points are kept, before `on_robot` drops some
std::size_t index_organized(const RawCloud& cloud, const CropParameters& crop, SelfFilter* on_robot,
                            ViewFilter* view, PointBvhBuilder* builder, PointBvh* bvh,
                            IngestCounts* counts);

/// Shows the view filter the part of a cloud that is near the robot; nothing is indexed.
/// @returns ViewFilter::end_pass()
bool look_at_robot(const RawCloud& cloud, const CropParameters& crop, SelfFilter* on_robot,
                   ViewFilter* view, PointBvhBuilder* builder);

}  // namespace ist
