#pragma once

#include <memory>
#include <string>

#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// A robot's description and its packed links.
struct RobotParts {
  RobotDescription description;             ///< names, joints and shapes
  std::shared_ptr<const RobotModel> model;  ///< built from the description; not null
};

/// A description and a model as bytes, for another process or machine: shapes and packings are in
/// them, so no mesh file is needed there, and nothing is packed again. Little-endian.
std::string serialize_robot(const RobotParts& robot);

/// The robot that the bytes hold; its trees are built anew.
/// @throws ModelError when the bytes are cut off, changed, or of another format
RobotParts parse_robot(const std::string& bytes);

}  // namespace ist
