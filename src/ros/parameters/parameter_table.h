#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/parameters.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// The table of the node's parameters, in the order in which a user meets them. The value of each
/// is in the configuration that is given, and its default is that of a new one. ~sources follow.
std::vector<Parameter> node_parameters(ServerConfig* config);

/// The rows of it that may change while the node runs.
std::vector<Parameter> live_parameters(ServerConfig* config);

/// The table of a source, which depends on its type. The first row is the type, or without ~sources
/// the timeout.
/// @param at  "sources/NAME/", or empty: the parameters beside ~sources
std::vector<Parameter> source_parameters(const std::string& at, SourceConfig* source);

/// An object of ~sources/NAME/objects as it is written.
struct WrittenObject {
  static const std::vector<std::string> kShapes;

  std::size_t shape = kShapes.size();  ///< of kShapes; their number: none
  Eigen::Vector3d size{1.0, 1.0, 1.0}, position{0.0, 0.0, 0.0}, rpy{0.0, 0.0, 0.0};
  double radius = 1.0, length = 1.0;
};

/// The table of an object, which depends on its shape. The first row is the shape.
/// @param at  "sources/NAME/objects/OBJECT/"
std::vector<Parameter> object_parameters(const std::string& at, WrittenObject* written,
                                         WorldObjectConfig* config);

/// Reads ~sources, or the parameters of the single source where ~sources is not set. Mistakes go to
/// the reader's errors.
std::vector<SourceConfig> read_sources(ParameterReader* reader);

/// Reads the objects of a known world, and checks that there is anything in it.
/// @param at  "sources/NAME/"
void read_world(ParameterReader* reader, const std::string& at, SourceConfig* source);

/// Reads a shape with its sizes, its place and its frame.
/// @param at          "zones/NAME/", for example
/// @param has_margin  a zone has none
void read_object(ParameterReader* reader, const std::string& at, bool has_margin,
                 WorldObjectConfig* config);

}  // namespace ist
