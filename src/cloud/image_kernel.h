#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/crop.h"

namespace ist {

constexpr std::size_t kTileSide = 4;     ///< pixels of a tile
constexpr std::size_t kTilesAtOnce = 4;  ///< side by side
constexpr std::size_t kTileColumns = kTilesAtOnce * kTileSide;

/// Four tiles side by side. Numbers of tile i stand in slot 4 i.
struct alignas(64) TileBoxes {
  float min[3][kTileColumns], max[3][kTileColumns];  ///< [m] of the pixels kept
  std::uint32_t kept[kTileSide];                     ///< by row: bit k for the pixel in column k
};

/// @param rows    four rows of an image, as crop_points left them
/// @param column  first column of the first tile, a multiple of kTileColumns
void tile_boxes(const CropBlock* rows, std::size_t column, TileBoxes* boxes);

}  // namespace ist
