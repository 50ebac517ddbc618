#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "cloud/filters/crop.h"
#include "internal/cloud/point_bvh.h"
#include "ist_proximity/cloud/cloud_layout.h"

namespace ist {

/// Moves a whole tile of an image, of which all pixels are kept, to the index's frame O in double.
/// @param first_pixel  its number in the message
void read_tile(const RawCloud& image, const Eigen::Isometry3d& X_OS, std::uint32_t first_pixel,
               PointTile* tile);

/// The same for what crop_tile has left of a tile; unused slots get no meaning.
void copy_kept(const CropBlock& block, std::size_t width, std::uint32_t first_pixel,
               PointTile* tile);

}  // namespace ist
