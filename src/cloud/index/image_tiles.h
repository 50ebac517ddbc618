#pragma once

#include <cstddef>

#include "cloud/filters/crop.h"
#include "cloud/filters/self_filter.h"
#include "cloud/index/point_bvh_builder.h"

namespace ist {

/// Whether a cloud is an image of surfaces: neighbours in the image are neighbours in space. Looks
/// at some blocks of pixels only; a matter of speed.
bool is_image(const RawCloud& cloud, const CropPose& pose);

/// Reads an image once and makes an index of it, without any sorting of points: squares of 4 x 4
/// pixels become tiles, squares of 4 x 4 tiles become nodes; at edges in depth a tile is split, and
/// tiles that no longer fill a node are grouped by where they are. Counts as crop().
/// @param on_robot  null: no self-filter
/// @param index  overwritten, its buffers reused
/// @returns how many points were kept before the self-filter
std::size_t index_image(const RawCloud& cloud, const CropPose& pose, const SelfFilter* on_robot,
                        PointBvhBuilder* builder, PointBvh* index, IngestCounts* counts);

}  // namespace ist
