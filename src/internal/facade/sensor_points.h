#pragma once

#include <string>

#include "ist_proximity/facade/obstacles.h"

namespace ist {

/// Reads the points of a file in the frame of their sensor, from which ranges count: `points` are
/// in S.
/// @throws as read_points()
PointFile read_sensor_points(const std::string& path);

}  // namespace ist
