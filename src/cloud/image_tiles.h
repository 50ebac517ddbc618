#pragma once

#include <cstddef>

#include "cloud/crop.h"
#include "cloud/point_index_builder.h"

namespace ist {

/// Whether a cloud is an image of surfaces: neighbours in the image are neighbours in space. Looks
/// at some blocks of pixels only; a matter of speed.
bool is_image(const RawCloud& cloud, const CropPose& pose);

/// Reads an image once and makes an index of it: blocks of 4 x 4 pixels become tiles, without any
/// sorting of points; at edges in depth a block is split. Counts as crop().
/// @param index  overwritten, its buffers reused
/// @returns how many points were kept before `drop`
std::size_t index_image(const RawCloud& cloud, const CropPose& pose, const PointFilter& drop,
                        PointIndexBuilder* builder, PointIndex* index, IngestCounts* counts);

}  // namespace ist
