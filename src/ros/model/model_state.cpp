#include "ros/model/model_state.h"

#include <algorithm>

#include "ros/common/frame_name.h"

namespace ist {

std::string no_kinematics(const ModelState& model) {
  return "link poses cannot be computed from the URDF: " + model.kinematics_problem;
}

std::string fixed_frame_of(const ModelState& model, const ServerConfig& config) {
  return config.fixed_frame.empty() ? without_slash(model.root_link) : config.fixed_frame;
}

std::vector<std::string> link_names(const RobotModel& robot) {
  std::vector<std::string> names;
  for (const LinkModel& link : robot.links) names.push_back(link.name);
  return names;
}

std::vector<bool> wanted_links(const ModelState& model) {
  std::vector<bool> wanted(model.robot->links.size(), false);
  for (const std::size_t i : model.monitored) wanted[i] = model.robot->links[i].usable();
  return wanted;
}

std::vector<std::string> monitored_links(const RobotDescription& description,
                                         const std::vector<std::string>& wanted) {
  std::vector<std::string> names;
  const auto is_wanted = [&](const std::string& name) {
    return wanted.empty() || std::find(wanted.begin(), wanted.end(), name) != wanted.end();
  };
  const auto has_geometry = [&](const std::string& name) {
    return std::any_of(description.links.begin(), description.links.end(),
                       [&](const LinkDescription& link) { return link.name == name; });
  };
  for (const std::string& name : description.link_order) {
    if (is_wanted(name) && (!wanted.empty() || has_geometry(name))) names.push_back(name);
  }
  for (const std::string& name : wanted) {  // not in the URDF
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

}  // namespace ist
