#pragma once

#include <tinyxml2.h>
#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include <string>
#include <vector>

namespace ist {

/// urdfdom's result for a URDF. After an error inside a link it continues without the faulty part,
/// so a model may come with errors.
struct ParsedUrdf {
  urdf::ModelInterfaceSharedPtr model;  ///< null when it gave up
  std::vector<std::string> errors;      ///< the cause first, then its consequences
};

/// Lets urdfdom read a document. Its messages are returned and not printed.
/// Thread safe: one call at a time, the others wait.
ParsedUrdf parse_with_urdfdom(const tinyxml2::XMLDocument& document);

}  // namespace ist
