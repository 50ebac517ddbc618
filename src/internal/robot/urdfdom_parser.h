#pragma once

#include <tinyxml2.h>
#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include <string>
#include <vector>

namespace ist {

/// What urdfdom makes of a URDF. After an error inside a link it goes on without the faulty part,
/// so a model may come with errors.
struct ParsedUrdf {
  urdf::ModelInterfaceSharedPtr model;  ///< null when it gave up
  std::vector<std::string> errors;      ///< the cause first, then what it led to
};

/// Lets urdfdom read a document; its messages come back here and are printed nowhere.
/// Thread safe: one call at a time, the others wait.
ParsedUrdf parse_with_urdfdom(const tinyxml2::XMLDocument& document);

}  // namespace ist
