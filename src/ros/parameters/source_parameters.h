#pragma once

#include <vector>

#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// Reads ~sources, or the parameters of the single source where ~sources is not set. Mistakes go to
/// the reader's errors.
std::vector<SourceConfig> read_sources(ParameterReader* reader);

/// Reads the objects of a known world, and checks that there is anything in it.
/// @param at  "sources/NAME/"
void read_world(ParameterReader* reader, const std::string& at, SourceConfig* source);

/// Reads a shape with its sizes, its place and its frame.
/// @param at  "zones/NAME/"
void read_placed_shape(ParameterReader* reader, const std::string& at, WorldObjectConfig* config);

}  // namespace ist
