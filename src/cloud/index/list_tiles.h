#pragma once

#include <cstddef>

#include "cloud/filters/crop_pose.h"
#include "cloud/filters/self_filter.h"
#include "cloud/index/point_bvh_builder.h"
#include "ist_proximity/cloud/cloud_layout.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// Indexes a cloud whose points come in any order: reads a message's bytes once, drops what is not
/// finite or not in range, and puts each point where its neighbours are.
///
/// Counts `not_a_number`, `infinite` and `outside_region`.
/// @param on_robot  may be null: nothing is dropped for it
/// @returns how many points are kept, before `on_robot` drops some
std::size_t index_list(const RawCloud& cloud, const CropPose& pose, const SelfFilter* on_robot,
                       PointBvhBuilder* builder, PointBvh* index, IngestCounts* counts);

}  // namespace ist
