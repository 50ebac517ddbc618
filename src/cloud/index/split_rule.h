#pragma once

#include <cstddef>

#include "internal/bvh/padded_box.h"

namespace ist {

// The one rule for where neighbouring points are apart, as at depth discontinuities: points that
// are apart get tiles of their own, tiles that are apart are not grouped into a node. The measure
// is the diagonal of boxes. Whoever forms tiles proposes where to split, in the way that its order
// of points makes cheap (between two pixels, in the middle of the longest side);
// is_split_worthwhile() decides. The other functions are cheap tests that come before it.

/// Share of the whole's diagonal below which the parts' diagonals add up when a split is
/// worthwhile. Four by four points of a plane, halved, come to 1.6; at a depth discontinuity it is
/// about 0.3. Measured on depth images and lidar scans, 0.6 to 0.8 is best: fewer splits leave long
/// tiles, more leave tiles half empty.
constexpr float kSplitBelow = 0.7F;

/// Whether two parts of some points are to be a tile each.
/// @param low, high  boxes of the parts
/// @param whole      box of all
inline bool is_split_worthwhile(const PaddedBox& low, const PaddedBox& high,
                                const PaddedBox& whole) {
  return low.diagonal() + high.diagonal() < kSplitBelow * whole.diagonal();
}

/// The axis along which a box is longest; of equal ones the first.
constexpr int longest_axis(float x, float y, float z) {
  return x >= y ? (x >= z ? 0 : 2) : (y >= z ? 1 : 2);
}

/// A split in the middle of the longest side is proposed only where no point lies between these
/// shares of the side.
constexpr float kMiddleBegin = 0.375F, kMiddleEnd = 0.625F;

/// A tile of an organized cloud on a plane is at most three times as long as its two steps from
/// pixel to pixel together. A longer one may be split. For squared lengths: the square of the sum
/// is at most twice the sum of the squares.
constexpr float kLongestTileSq = 2.0F * 3.0F * 3.0F;

/// A block of an organized cloud, in which no tile is longer than `kLongestOfMean` times the mean
/// and whose own diagonal is at least `kBlockOfMean` times the mean (on a plane four times), has no
/// tile to split.
constexpr float kLongestOfMean = 2.0F, kBlockOfMean = 3.0F;

/// Whether a tile is about as long as those of the same block that are known to need no split.
/// @param diagonal_sq  [m^2] of the tile
/// @param sum_sq       [m^2] sum of the squared diagonals of the others, `count` of them
inline bool is_as_long_as(float diagonal_sq, float sum_sq, float count) {
  constexpr float kLonger = 1.5F;
  return count > 0.0F && diagonal_sq * count <= kLonger * kLonger * sum_sq;
}

/// Whether neighbouring tiles lie side by side and may be a node. Four by four square tiles
/// together are four times as long as one of them; where they are much longer, they are apart.
/// @param diagonal  [m] of the box of all
/// @param sum       [m] of the tiles' diagonals, `count` of them
inline bool are_close_together(float diagonal, float sum, std::size_t count) {
  constexpr float kLongest = 6.0F;
  return diagonal * static_cast<float>(count) <= kLongest * sum;
}

}  // namespace ist
