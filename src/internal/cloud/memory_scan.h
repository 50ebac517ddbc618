#pragma once

#include <Eigen/Geometry>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/memory_map.h"

namespace ist {

/// Reads what a cloud sees. Points that are in the snapshot, or in a zone, are obstacles. Rays are
/// free up to the other points in range, which are on the robot or outside the region of interest,
/// and up to `max_range` where a point is farther or, in a depth image, nothing is in range. A
/// pixel or point of which nothing is known (NaN), nearer than `min_range`, or farther than is
/// believed, says nothing.
/// @param cloud      that the snapshot was made of
/// @param X_MS       sensor frame -> memory's frame, of the sensor where the snapshot has it (X_FS)
/// @param min_range  [m] of the snapshot's Ingest
/// @param max_range  [m] finite
/// @param scan       overwritten, its memory used again
/// @param in_zones   what Ingest::set_zones() kept of the cloud for other groups
void read_memory_scan(const RawCloud& cloud, const CloudSnapshot& snapshot,
                      const Eigen::Isometry3d& X_MS, double min_range, double max_range,
                      MemoryScan* scan, Span<const CloudSnapshot> in_zones = {});

}  // namespace ist
