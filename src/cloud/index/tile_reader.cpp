#include "cloud/index/tile_reader.h"

#include <algorithm>

#include "cloud/index/tile_split_kernel.h"

namespace ist {
namespace {

constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
static_assert(kTileSide * kTileSide == kSlots, "a square of pixels fills a tile");

void number_pixels(std::size_t width, std::uint32_t first_pixel, PointTile* tile) {
  for (std::size_t k = 0; k < kSlots; ++k) {
    tile->id[k] = first_pixel + static_cast<std::uint32_t>(k / kTileSide * width + k % kTileSide);
  }
  tile->count = kPointWidth;
}

}  // namespace

void read_tile(const RawCloud& cloud, const Eigen::Isometry3d& X_OS, std::uint32_t first_pixel,
               PointTile* tile) {
  move_tile(cloud, first_pixel / cloud.width, first_pixel % cloud.width, X_OS, tile->x, tile->y,
            tile->z);
  number_pixels(cloud.width, first_pixel, tile);
}

void copy_kept(const CropBatch& batch, std::size_t width, std::uint32_t first_pixel,
               PointTile* tile) {
  PointTile all;
  std::copy_n(batch.x, kSlots, all.x);
  std::copy_n(batch.y, kSlots, all.y);
  std::copy_n(batch.z, kSlots, all.z);
  number_pixels(width, first_pixel, &all);
  std::uint32_t kept = 0;
  for (std::size_t k = 0; k < kSlots; ++k) {
    kept |= static_cast<std::uint32_t>(batch.x[k] == batch.x[k]) << k;
  }
  pick_points(all, kept, tile);
}

}  // namespace ist
