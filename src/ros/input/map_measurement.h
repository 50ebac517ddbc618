#pragma once

#include <topic_tools/shape_shifter.h>

#include <string>

#include "ist_proximity/cloud/octree.h"
#include "ros/input/measurement.h"

namespace ist {

/// Reads an octomap_msgs/Octomap from its bytes, so that octomap_msgs is not needed.
Received read_map(const topic_tools::ShapeShifter& message, const OctreeLimits& limits);

/// Reads a map file. The header of the result has no stamp.
Received read_map_file(const std::string& path, const std::string& frame_id,
                       const OctreeLimits& limits);

}  // namespace ist
