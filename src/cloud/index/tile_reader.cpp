#include "cloud/index/tile_reader.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "cloud/index/tile_split_kernel.h"

namespace ist {
namespace {

constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
static_assert(kTileSide * kTileSide == kSlots, "a square of pixels fills a tile");

void copy_all(const CropBatch& block, std::size_t width, std::uint32_t first_pixel,
              PointTile* tile) {
  std::copy_n(block.x, kSlots, tile->x);
  std::copy_n(block.y, kSlots, tile->y);
  std::copy_n(block.z, kSlots, tile->z);
  for (std::size_t k = 0; k < kSlots; ++k) {
    tile->id[k] = first_pixel + static_cast<std::uint32_t>(k / kTileSide * width + k % kTileSide);
  }
  tile->count = kPointWidth;
}

}  // namespace

void read_tile(const RawCloud& image, const Eigen::Isometry3d& X_OS, std::uint32_t first_pixel,
               PointTile* tile) {
  CropParameters pose;
  pose.X_OS = X_OS;
  pose.max_range_sq = std::numeric_limits<double>::max();
  CropBatch block;
  IngestCounts unused;
  const std::size_t kept =
      crop_tile(image, first_pixel / image.width, first_pixel % image.width, pose, &block, &unused);
  assert(kept == kSlots);
  static_cast<void>(kept);
  copy_all(block, image.width, first_pixel, tile);
}

void copy_kept(const CropBatch& block, std::size_t width, std::uint32_t first_pixel,
               PointTile* tile) {
  PointTile all;
  copy_all(block, width, first_pixel, &all);
  std::uint32_t kept = 0;
  for (std::size_t k = 0; k < kSlots; ++k) {
    kept |= static_cast<std::uint32_t>(block.x[k] == block.x[k]) << k;
  }
  pick_points(all, kept, tile);
}

}  // namespace ist
