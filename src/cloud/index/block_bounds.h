#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/filters/crop.h"
#include "internal/bvh/box_node.h"
#include "internal/cloud/point_tile.h"

namespace ist {

/// An organized cloud is read in blocks of 16 x 16 pixels: sixteen tiles of 4 x 4. The tile in row
/// r and column c of tiles has slot 4 r + c.
constexpr std::size_t kBlockSide = 16;                       ///< pixels
constexpr std::size_t kBlockTiles = kBlockSide / kTileSide;  ///< along each side of a block

/// A tile's pixels are bits: 4 r + c is the one in row r and column c. This is all of them.
constexpr std::uint32_t kWholeTile = 0xFFFFU;

/// The first pixel of the tile in a slot, from the block's first pixel.
constexpr std::size_t tile_row(std::size_t slot) { return kTileSide * (slot / kBlockTiles); }
constexpr std::size_t tile_column(std::size_t slot) { return kTileSide * (slot % kBlockTiles); }

/// Bound of the rounding of a box's coordinate, as a share of the range and the translation
/// together. A pixel's coordinate is rounded as it is read, rotated (three numbers, three products)
/// and moved (one number, three sums), the stored point once, the box once: ten times, each by at
/// most 2^-24.
constexpr float kBoxError = 12.0F / (1 << 24);

/// The parameters of a crop in float, of which a vector holds twice as many as of double. Boxes are
/// widened by the rounding, and range limits come in pairs that leave room for it.
struct BlockTransform {
  explicit BlockTransform(const CropParameters& crop);
  /// The same where every pixel that is no NaN is known to be kept.
  BlockTransform without_limits() const;

  float R[9];         ///< rotation of X_OS, row-major
  float t[3];         ///< [m] its translation
  float translation;  ///< [m] its length, at least
  /// [m^2] Squared ranges. A pixel from `keep_from` to `keep_to` is kept, one below `drop_below` or
  /// above `drop_above` is not, whatever float rounds off. The others are decided in double.
  float keep_from, keep_to, drop_below, drop_above;
  float believed;  ///< [m^2] CropParameters::believed_sq, which float may round
};

/// Points of four floats (x, y, z and anything), as they are in a message or copied from it.
struct BlockPixels {
  const float* points;
  std::size_t step;    ///< [floats] from point to point, at least 4
  std::size_t stride;  ///< [floats] from row to row
};

/// Bounds of the sixteen tiles of a block.
struct alignas(64) BlockBounds {
  /// [m] in O: boxes that hold the pixels kept of each tile, and are no larger than rounding makes
  /// them; inverted where no pixel is kept.
  BoxNode boxes;
  float diagonal_sq[kPointWidth];   ///< [m^2] of the boxes, before they are widened
  std::uint32_t kept[kPointWidth];  ///< by slot: bit 4 r + c for the pixel in row r and column c
  float min[3], max[3];             ///< [m] the box of all
  float diagonals;                  ///< [m] sum, if all pixels are kept
  /// Bit k: the tile in slot k may span a depth discontinuity, as far as its corners show: they say
  /// how far apart pixels are on its surface. Undefined where not all pixels are kept.
  std::uint32_t may_have_edge;
  /// Pixels that are NaN, nearer than the least range, and farther than is believed.
  std::uint32_t not_a_number, too_near, not_believed;
};

enum class BlockState {
  kAll,      ///< all pixels are kept; `kept` is not set
  kNone,     ///< all are NaN; the bounds are not set
  kSome,     ///< some pixels are kept, or none
  kUnclear,  ///< float cannot decide which pixels are kept; the bounds are not set
};

/// Finds which pixels of a block are kept, and the bounds of its tiles.
BlockState bound_block(const BlockTransform& transform, const BlockPixels& pixels,
                       BlockBounds* block);

}  // namespace ist
