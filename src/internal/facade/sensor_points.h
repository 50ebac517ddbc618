#pragma once

#include <string>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/obstacles.h"

namespace ist {

/// Reads the points of a file in the frame of their sensor, from which ranges count: `points` are
/// in S.
/// @throws as read_points()
PointFile read_sensor_points(const std::string& path);

/// The points of a file as a cloud that keeps them; float32 where that is exact, so that a file's
/// answers are those of the cloud that was written to it.
RawCloud to_cloud(PointFile file);

}  // namespace ist
