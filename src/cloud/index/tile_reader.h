#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "cloud/filters/crop.h"
#include "internal/cloud/point_tile.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Reads a tile of an organized cloud, of which all pixels are kept, and moves its points to the
/// index's frame O in double.
/// @param first_pixel  its number in the message
void read_tile(const RawCloud& cloud, const Eigen::Isometry3d& X_OS, std::uint32_t first_pixel,
               PointTile* tile);

/// Copies the pixels of a tile that crop_tile() has kept; unused slots are undefined.
/// @param width  [pixels] of the cloud
void copy_kept(const CropBatch& batch, std::size_t width, std::uint32_t first_pixel,
               PointTile* tile);

}  // namespace ist
