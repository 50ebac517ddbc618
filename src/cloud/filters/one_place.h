#pragma once

#include <cstdint>

#include "cloud/filters/crop_parameters.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Counts the points of IngestCounts::at_one_place: 0 unless several points, and more than half of
/// those in a range that counts, have the same coordinates. Rays in different directions do not end
/// at one point, so these are no measurements. Depths and ranges say nothing of the kind: those of
/// a wall or of a round room are all the same.
/// @param crop  of the cloud
std::uint32_t points_at_one_place(const RawCloud& cloud, const CropParameters& crop);

}  // namespace ist
