#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/filters/crop.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

constexpr std::size_t kPatchSide = 16;                       ///< pixels
constexpr std::size_t kPatchTiles = kPatchSide / kTileSide;  ///< along each side of a patch

/// By slot: the tile's first pixel in the patch.
constexpr std::size_t tile_row(std::size_t slot) { return kTileSide * (slot / kPatchTiles); }
constexpr std::size_t tile_column(std::size_t slot) { return kTileSide * (slot % kPatchTiles); }

/// A plane's tile is at most three times as long as its two steps from pixel to pixel together;
/// what is longer is looked at closely. Here with squares, of which the sum has a factor of 2.
constexpr float kLongestTile = 2.0F * 3.0F * 3.0F;

/// A pixel's coordinate is rounded as it is read, turned (three numbers, three products) and moved
/// (one number, three sums), the stored point once, the box once: ten times, each by at most 2^-24
/// of the range and the translation together.
constexpr float kBoxError = 12.0F / (1 << 24);

/// How boxes are made of pixels: in float, of which a vector holds twice as many as of double, and
/// wider by what that may be off.
struct PatchPose {
  explicit PatchPose(const CropPose& pose);
  /// The same, for pixels of which all that are numbers are known to be kept.
  PatchPose without_limits() const;

  float R[9];         ///< rotation of X_OS, row-major
  float t[3];         ///< [m] its translation
  float translation;  ///< [m] its length, at least
  /// [m^2] Squared ranges: a pixel between the first two is kept, one below the third or above the
  /// fourth is not, whatever float rounds off. Of the others only double tells.
  float least, most, none_below, none_above;
};

/// Points of four floats (x, y, z and anything), as they are in a message or copied from it.
struct PatchPixels {
  const float* points;
  std::size_t step;    ///< [floats] from point to point, at least 4
  std::size_t stride;  ///< [floats] from row to row
};

/// What an image's square of 16 x 16 pixels holds: sixteen tiles of 4 x 4. The tile in row r and
/// column c of tiles has slot 4 r + c.
struct alignas(64) Patch {
  BoxNode boxes;                    ///< [m] in O, of the pixels kept, at least; inverted where none
  float diagonal_sq[kPointWidth];   ///< [m^2] of the boxes
  std::uint32_t kept[kPointWidth];  ///< by slot: bit 4 r + c for the pixel in row r and column c
  float min[3], max[3];             ///< [m] the box around all
  float diagonals;                  ///< [m] sum, if all pixels are kept
  /// Bit k: the tile in slot k may span an edge in depth, as far as its corners tell: they say how
  /// far apart pixels are on its surfaces. Without meaning where not all pixels are kept.
  std::uint32_t suspicious;
  std::uint32_t not_a_number;  ///< pixels
};

enum class PatchState {
  kAll,      ///< all pixels are kept
  kNone,     ///< all are NaN; nothing but this is told
  kSome,     ///< or none
  kUnclear,  ///< float does not tell which; nothing but this is told
};

PatchState survey_patch(const PatchPose& pose, const PatchPixels& pixels, Patch* patch);

}  // namespace ist
