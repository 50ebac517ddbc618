#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Something that a link carries, a gripped tool: while it is attached, it is a part of the link.
struct AttachedObject {
  std::string name;
  std::string link;
  GeometryElement element;  ///< its frame E is the object's
};

/// The robot with the objects as further elements of their links.
/// @throws ModelError when a link is not in the URDF, or its own geometry is faulty
RobotDescription with_objects(const RobotDescription& robot,
                              const std::vector<AttachedObject>& objects);

/// The model with one link built anew, and the other links as they are: what build_robot_model
/// would make of the description, without packing everything.
/// @param model   of a description that differs in that link only, built with `config`
/// @param link    without geometry it leaves the model, unless `config.links` asks for it
/// @returns null when cancelled
std::shared_ptr<const RobotModel> rebuild_link(const RobotModel& model,
                                               const RobotDescription& description,
                                               const std::string& link,
                                               const RobotModelConfig& config,
                                               const RobotModelCallbacks& callbacks = {});

}  // namespace ist
