#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// An object that a link carries, such as a gripped tool: while attached, it is a part of the link.
struct AttachedObject {
  std::string name;         ///< name of the object
  std::string link;         ///< name of the link that carries it
  GeometryElement element;  ///< its frame E is the object's
};

/// Adds the objects to the robot as further elements of their links.
/// @throws ModelError when a link is not in the URDF, or its own geometry is faulty
RobotDescription with_objects(const RobotDescription& robot,
                              const std::vector<AttachedObject>& objects);

/// Builds one link of the model anew and copies the others: the same result as build_robot_model
/// for the description, without packing everything.
/// @param model   of a description that differs in that link only, built with `config`
/// @param link    without geometry it is removed from the model, unless `config.links` names it
/// @returns null when cancelled
std::shared_ptr<const RobotModel> rebuild_link(const RobotModel& model,
                                               const RobotDescription& description,
                                               const std::string& link,
                                               const RobotModelConfig& config,
                                               const RobotModelCallbacks& callbacks = {});

}  // namespace ist
