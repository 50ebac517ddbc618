#pragma once

#include <string>

#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// Reads the parameters of a source of type `world`. Mistakes go to the reader's errors.
/// @param prefix  "sources/NAME/"
void read_world(ParameterReader* reader, const std::string& prefix, SourceConfig* source);

}  // namespace ist
