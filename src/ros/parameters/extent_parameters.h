#pragma once

#include <string>

#include "ist_proximity/cloud/point_extent.h"
#include "ros/parameters/parameter_reader.h"

namespace ist {

/// Reads `noise`, `footprint` and `latency` of a source: what makes its points larger than points.
/// @param prefix  of their names
/// @param config  holds the defaults
void read_extent(ParameterReader* reader, const std::string& prefix, ExtentConfig* config);

/// Adds an error where the points' radius at max_range [m] has no sensible size; `config` asks for
/// nothing then.
void require_extent(ParameterReader* reader, const std::string& prefix, double max_range,
                    ExtentConfig* config);

/// The same for a map, whose boxes have one radius: it has no sensor from which ranges count.
void require_map_extent(ParameterReader* reader, const std::string& prefix, ExtentConfig* config);

}  // namespace ist
