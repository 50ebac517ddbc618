#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/filters/crop.h"
#include "cloud/filters/self_filter.h"
#include "cloud/filters/view_filter.h"
#include "cloud/filters/zone_filter.h"
#include "cloud/index/block_bounds.h"
#include "cloud/index/point_bvh_builder.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// The filters whose points an index leaves out. Each may be null.
struct CloudFilters {
  SelfFilter* on_robot = nullptr;
  /// In place of all that is within the self-filter's padding, what the view filter, which
  /// look_at_robot() has shown the cloud, takes for the robot.
  ViewFilter* view = nullptr;
  const ZoneFilter* zones = nullptr;
};

/// Whether a cloud is organized: an image of surfaces, in which neighbouring pixels are neighbours
/// in space. Samples some blocks of pixels; the answer decides how fast the cloud is indexed, not
/// what is found.
bool is_organized(const RawCloud& cloud, const CropParameters& crop);

/// The blocks of a cloud that the view filter has looked at: their bounds are computed once, and
/// used by index_organized(). Keeps its memory.
struct LookedBlocks {
  struct Block {
    BlockBounds bounds;
    std::uint32_t kept;  ///< pixels; 0: the bounds are not set
    bool is_whole;       ///< all pixels are kept, none of them near a limit
    bool is_on_robot;    ///< the view filter has a tile of it
  };
  std::vector<Block> blocks;  ///< row by row
  IngestCounts counts;        ///< of the whole cloud
  std::size_t kept = 0;       ///< points of the whole cloud
};

/// Reads an organized cloud once and builds its index without sorting points: squares of 4 x 4
/// pixels become tiles, squares of 4 x 4 tiles become nodes. At depth discontinuities a tile is
/// split, and tiles that no longer fill a node are grouped by where they are. Counts
/// `not_a_number`, `infinite`, `outside_region` and `in_zones`.
/// @param looked    what look_at_robot() has found with the same crop; null without a view filter
/// @param bvh  overwritten, its buffers reused
/// @returns how many points are kept, before the filters drop some
std::size_t index_organized(const RawCloud& cloud, const CropParameters& crop,
                            const CloudFilters& filters, const LookedBlocks* looked,
                            PointBvhBuilder* builder, PointBvh* bvh, IngestCounts* counts);

/// Shows the view filter the part of a cloud that is near the robot; nothing is indexed.
/// @param looked  overwritten
/// @returns ViewFilter::end_pass()
bool look_at_robot(const RawCloud& cloud, const CropParameters& crop, SelfFilter* on_robot,
                   ViewFilter* view, PointBvhBuilder* builder, LookedBlocks* looked);

}  // namespace ist
