#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/crop.h"
#include "ist_proximity/cloud/point_index.h"

namespace ist {

constexpr std::size_t kTileSide = 4;                         ///< pixels of a tile
constexpr std::size_t kPatchTiles = kPatchSide / kTileSide;  ///< along each side of a patch

/// A plane's tile is at most three times as long as its two steps from pixel to pixel together;
/// what is longer is looked at closely. Here with squares, of which the sum has a factor of 2.
constexpr float kLongestTile = 2.0F * 3.0F * 3.0F;

/// By slot: the tile's first pixel in the patch.
constexpr std::size_t tile_row(std::size_t slot) { return kTileSide * (slot % kPatchTiles); }
constexpr std::size_t tile_column(std::size_t slot) { return kTileSide * (slot / kPatchTiles); }

/// The sixteen tiles of a patch. The tile in row r and column c of tiles has slot 4 c + r.
struct alignas(64) PatchTiles {
  BoxNode boxes;                   ///< [m] of the pixels kept, inverted where there are none
  float diagonal_sq[kPointWidth];  ///< [m^2] of the boxes
  std::uint32_t kept[kPatchSide];  ///< by row of pixels: bit k for the pixel in column k
  /// Bit k: the tile in slot k may span an edge in depth, as far as its corners tell: they say how
  /// far apart pixels are on its surfaces. Without meaning where not all pixels are kept.
  std::uint32_t suspicious;

  /// All pixels are kept, and no tile may span an edge.
  bool is_plain() const {
    std::uint32_t all = 0xFFFFU;
    for (const std::uint32_t row : kept) all &= row;
    return all == 0xFFFFU && suspicious == 0;
  }

  /// Bit 4 r + c: the pixel in row r and column c of the tile.
  std::uint32_t kept_of(std::size_t slot) const {
    const std::uint32_t* rows = kept + tile_row(slot);
    const std::size_t column = tile_column(slot);
    return (rows[0] >> column & 0xFU) | (rows[1] >> column & 0xFU) << 4 |
           (rows[2] >> column & 0xFU) << 8 | (rows[3] >> column & 0xFU) << 12;
  }
};

/// @param block  as crop_patch left it
void find_tiles(const CropBlock& block, PatchTiles* tiles);

/// Writes tiles of the pixels kept, unused slots far away, in the order of their slots.
/// @param which  bit k: the tile in slot k, of which a pixel at least is kept
/// @param id     of the patch's first pixel
/// @param width  of the image, in pixels
/// @param to     as many as there are bits
void write_tiles(const CropBlock& block, const PatchTiles& tiles, std::uint32_t which,
                 std::uint32_t id, std::uint32_t width, PointTile* to);

}  // namespace ist
