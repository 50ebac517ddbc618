#pragma once

#include <topic_tools/shape_shifter.h>

#include <string>

#include "ros/input/measurement.h"

namespace ist {

/// An octomap_msgs/Octomap, read from its bytes: that package is not needed.
Received read_map(const topic_tools::ShapeShifter& message);

/// A map file. Its header has no stamp.
Received read_map_file(const std::string& path, const std::string& frame_id);

}  // namespace ist
