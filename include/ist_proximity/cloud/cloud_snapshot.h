#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <string>

#include "ist_proximity/cloud/box_index.h"
#include "ist_proximity/cloud/point_index.h"
#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

/// What became of the points of one cloud.
struct IngestCounts {
  std::uint32_t received = 0;        ///< points in the message
  std::uint32_t not_a_number = 0;    ///< dropped: a coordinate is NaN
  std::uint32_t infinite = 0;        ///< dropped: a coordinate is infinite, and none is NaN
  std::uint32_t out_of_range = 0;    ///< dropped: nearer than min_range or beyond max_range
  std::uint32_t outside_region = 0;  ///< dropped: in range, but no link gets near
  std::uint32_t noise = 0;           ///< dropped by a noise filter that ran before
  std::uint32_t on_robot = 0;        ///< dropped by the self-filter
  std::uint32_t used = 0;            ///< what queries see

  /// Every point of a cloud that holds some is NaN (or noise): the sensor saw nothing at all.
  bool saw_nothing() const { return received > 0 && not_a_number + noise == received; }
};

/// One cloud or map, as queries see it: immutable. A cloud is points in the fixed frame; a map is
/// solid boxes in a frame of its own.
struct CloudSnapshot {
  PointIndex index;         ///< all points used
  PointIndex coarse;        ///< the same, thinned to one point per cell; empty where not asked for
  double thinning = 0.01;   ///< [m] edge of such a cell
  RegionOfInterest region;  ///< where the points end
  std::shared_ptr<const BoxIndex> boxes;                   ///< of a map; null: none
  Eigen::Isometry3d X_FM = Eigen::Isometry3d::Identity();  ///< the boxes' frame -> fixed frame
  IngestCounts counts;
  double stamp = 0.0;        ///< [s] acquisition
  double ingest_time = 0.0;  ///< [s] it took
};

/// The clouds and maps of one query, in the order of their sources.
using SnapshotSpan = Span<const CloudSnapshot* const>;

}  // namespace ist
