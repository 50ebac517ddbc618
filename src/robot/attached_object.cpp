#include "ist_proximity/robot/robot_model.h"

#include <algorithm>
#include <utility>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

LinkDescription& link_to_carry(const AttachedObject& object, RobotDescription* robot) {
  const std::string who = "object '" + printable(object.name) + "'";
  for (LinkDescription& link : robot->links) {
    if (link.name != object.link) continue;
    if (link.error.empty()) return link;
    throw ModelError(who + " cannot be attached: " + link.error);
  }
  auto& bare = robot->links_without_geometry;
  const auto found = std::find(bare.begin(), bare.end(), object.link);
  if (found == bare.end()) {
    throw ModelError(who + " cannot be attached: link '" + printable(object.link) +
                     "' is not in the URDF of robot '" + robot->name + "'");
  }
  bare.erase(found);
  robot->links.emplace_back();
  robot->links.back().name = object.link;
  return robot->links.back();
}

}  // namespace

RobotDescription with_objects(const RobotDescription& robot,
                              const std::vector<AttachedObject>& objects) {
  RobotDescription result = robot;
  for (const AttachedObject& object : objects) {
    LinkDescription& link = link_to_carry(object, &result);
    link.geometry.push_back(object.element);
    ++link.attached;
  }
  return result;
}

}  // namespace ist
