#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/format/cloud_point.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

/// Points that the functions below may read beyond the last.
constexpr std::size_t kPointSlack = 16;

/// Of the box of some points [m].
struct BoxShape {
  float longest = 0.0F, second = 0.0F;  ///< sides
};

/// Into which of `count` slices of equal width points fall, across the longest side of their box.
/// @param points  one at least
/// @param slices  by point; room for kPointSlack more
/// @returns false: the points are one, or as good as one, and have no slices
bool find_slices(const CloudPoint* points, std::size_t n, std::int32_t count, std::int32_t* slices,
                 BoxShape* shape);

/// Tiles in work, and their boxes.
struct TileBatch {
  static constexpr std::size_t kMost = 1024;

  PointTile* tiles = nullptr;  ///< room for a tile a point
  BoxNode boxes[kMost / 16];   ///< of exactly their points: of tile i in slot i % 16 of i / 16
  std::size_t count = 0;
};

/// Appends tiles of sixteen points each, as they come, the last of fewer; those with a gap are
/// divided further. Unused slots are far away.
/// @param points  in all no more than TileBatch::kMost; change places
void make_tiles(CloudPoint* points, std::size_t n, TileBatch* batch);

}  // namespace ist
