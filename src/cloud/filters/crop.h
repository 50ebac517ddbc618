#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>

#include "cloud/filters/crop_parameters.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Points that are read at a time: they fit the first-level cache.
constexpr std::size_t kCropBatch = 256;

/// Coordinates of some points [m] in the frame O. Where `x` is NaN, the point is dropped, and its y
/// and z are undefined.
struct alignas(64) CropBatch {
  float x[kCropBatch], y[kCropBatch], z[kCropBatch];
};

/// Reads some points of one row from the message's bytes, decides in double which are kept, and
/// moves those to O. Counts `not_a_number`, `infinite`, `outside_region`, `too_near` and
/// `not_believed`.
/// @param row, column  of the first point
/// @param count  at most kCropBatch
/// @returns how many are kept
std::size_t crop_points(const RawCloud& cloud, std::size_t row, std::size_t column,
                        std::size_t count, const CropParameters& crop, CropBatch* batch,
                        IngestCounts* counts);

/// Pixels along each side of a tile of an organized cloud.
constexpr std::size_t kTileSide = 4;

/// The same for a tile: the pixel in row r and column c of the tile goes to slot 4 r + c. Pixels
/// outside the cloud are dropped and not counted.
/// @param row, column  of the first pixel
std::size_t crop_tile(const RawCloud& cloud, std::size_t row, std::size_t column,
                      const CropParameters& crop, CropBatch* batch, IngestCounts* counts);

/// Moves the pixels of a whole tile to O, of which crop_tile() keeps all: the same bits.
/// @param row, column  of the first pixel
/// @param x,y,z        [m] by slot, aligned to 64 bytes; overwritten
void move_tile(const RawCloud& cloud, std::size_t row, std::size_t column,
               const Eigen::Isometry3d& X_OS, float* x, float* y, float* z);

}  // namespace ist
