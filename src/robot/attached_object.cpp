#include "ist_proximity/robot/robot_model.h"

#include <algorithm>
#include <utility>

#include "internal/bvh/build_id.h"
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

/// Rank of a link among those of the URDF; names that it lacks come last.
std::ptrdiff_t rank(const RobotDescription& robot, const std::string& link) {
  const auto& order = robot.link_order;
  return std::find(order.begin(), order.end(), link) - order.begin();
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

std::shared_ptr<const RobotModel> rebuild_link(const RobotModel& model,
                                               const RobotDescription& description,
                                               const std::string& link,
                                               const RobotModelConfig& config,
                                               const RobotModelCallbacks& callbacks) {
  const auto contains = [&](const std::vector<std::string>& names) {
    return std::find(names.begin(), names.end(), link) != names.end();
  };
  auto result = std::make_shared<RobotModel>(model);
  result->geometry_id = next_build_id();
  auto& links = result->links;
  const auto old = std::find_if(links.begin(), links.end(),
                                [&](const LinkModel& other) { return other.name == link; });
  const bool wanted =
      config.links.empty() ? !contains(description.links_without_geometry) : contains(config.links);
  if (!wanted) {
    if (old != links.end()) links.erase(old);
    return result;
  }
  RobotModelConfig alone = config;
  alone.links = {link};
  const auto built = build_robot_model(description, alone, callbacks);
  if (!built) return nullptr;
  if (old != links.end()) {
    *old = built->links.front();
    return result;
  }
  const auto after = std::find_if(links.begin(), links.end(), [&](const LinkModel& other) {
    return rank(description, other.name) > rank(description, link);
  });
  links.insert(after, built->links.front());
  return result;
}

}  // namespace ist
