#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/filters/crop_pose.h"
#include "ist_proximity/cloud/cloud_layout.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// Points that are read at a time: they fit the first-level cache.
constexpr std::size_t kCropBlock = 256;

/// Coordinates of a block [m] in the frame O. Where `x` is NaN, the point is to be dropped; its y
/// and z have no meaning.
struct alignas(64) CropBlock {
  float x[kCropBlock], y[kCropBlock], z[kCropBlock];
};

/// Reads some points of one row from the message's bytes, moves them to O in double, and counts
/// `not_a_number` and `infinite`.
/// @param count  at most kCropBlock
/// @returns how many are kept
std::size_t crop_points(const RawCloud& cloud, std::size_t row, std::size_t column,
                        std::size_t count, const CropPose& pose, CropBlock* block,
                        IngestCounts* counts);

constexpr std::size_t kTileSide = 4;  ///< pixels; a tile of an image is a square of them

/// The same for a square of an image: the pixel in row r and column c of it goes to slot 4 r + c.
/// Pixels beyond the image's edges are dropped, and count for nothing.
/// @param row, column  of the first pixel
std::size_t crop_tile(const RawCloud& cloud, std::size_t row, std::size_t column,
                      const CropPose& pose, CropBlock* block, IngestCounts* counts);

}  // namespace ist
