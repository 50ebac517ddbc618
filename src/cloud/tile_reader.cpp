#include "cloud/tile_reader.h"

#include <algorithm>
#include <cassert>
#include <limits>

namespace ist {
namespace {

constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
static_assert(kTileSide * kTileSide == kSlots, "a square of pixels fills a tile");

std::uint32_t pixel(std::size_t slot, std::size_t width, std::uint32_t first) {
  return first + static_cast<std::uint32_t>(slot / kTileSide * width + slot % kTileSide);
}

}  // namespace

void read_tile(const RawCloud& image, const Eigen::Isometry3d& X_OS, std::uint32_t first_pixel,
               PointTile* tile) {
  CropPose pose;
  pose.X_OS = X_OS;
  pose.max_range_sq = std::numeric_limits<double>::max();
  CropBlock block;
  IngestCounts unused;
  const std::size_t kept =
      crop_tile(image, first_pixel / image.width, first_pixel % image.width, pose, &block, &unused);
  assert(kept == kSlots);
  static_cast<void>(kept);
  std::copy_n(block.x, kSlots, tile->x);
  std::copy_n(block.y, kSlots, tile->y);
  std::copy_n(block.z, kSlots, tile->z);
  for (std::size_t k = 0; k < kSlots; ++k) tile->id[k] = pixel(k, image.width, first_pixel);
  tile->count = kPointWidth;
}

void copy_kept(const CropBlock& block, std::size_t width, std::uint32_t first_pixel,
               PointTile* tile) {
  std::int32_t n = 0;
  for (std::size_t k = 0; k < kSlots; ++k) {
    if (block.x[k] != block.x[k]) continue;
    tile->x[n] = block.x[k];
    tile->y[n] = block.y[k];
    tile->z[n] = block.z[k];
    tile->id[n] = pixel(k, width, first_pixel);
    ++n;
  }
  tile->count = n;
  for (; n < kPointWidth; ++n) {
    tile->x[n] = tile->y[n] = tile->z[n] = kFarAway;
    tile->id[n] = 0;
  }
}

}  // namespace ist
