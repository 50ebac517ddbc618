#pragma once

#include <string>
#include <vector>

#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// Reads ~sources, or the parameters of the single source where ~sources is not set. Mistakes go to
/// the reader's errors.
std::vector<SourceConfig> read_sources(ParameterReader* reader);

/// Reads what a source of type `world` has besides `topic` and `required`.
/// @param at  the prefix of their names, with the slash at its end
void read_world(ParameterReader* reader, const std::string& at, SourceConfig* source);

/// Reads a path that has to be absolute.
void read_path(ParameterReader* reader, const std::string& name, const char* example,
               std::string* path, bool may_be_empty = false);

}  // namespace ist
