#include "ros/model/model_state.h"

#include <set>
#include <unordered_set>

#include "internal/geometry/limits.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"

namespace ist {

bool is_refinement(const ModelState& before, const ModelState& after) {
  return before.is_ready() && after.is_ready() && before.robot && after.robot &&
         same_geometry(*before.robot, *after.robot);
}

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

std::string unmonitored_name(const std::vector<std::string>& names, const ModelState& model) {
  const std::set<std::string> known(model.links.begin(), model.links.end());
  for (const std::string& name : names) {
    if (known.count(name) > 0) continue;
    return quoted(printable(name)) + " is no monitored link" + did_you_mean(name, known);
  }
  return "";
}

std::vector<bool> wanted_links(const ModelState& model) {
  std::vector<bool> wanted(model.robot->links.size(), false);
  for (const std::size_t i : model.monitored) wanted[i] = model.robot->links[i].usable();
  return wanted;
}

std::shared_ptr<const ModelState> with_paired(std::shared_ptr<const ModelState> model) {
  if (model->paired.empty()) return model;
  auto result = std::make_shared<ModelState>(*model);
  for (const std::size_t i : model->paired) {
    result->monitored.push_back(i);
    result->links.push_back(model->robot->links[i].name);
  }
  result->paired.clear();
  return result;
}

std::vector<std::string> monitored_links(const RobotDescription& description,
                                         const std::vector<std::string>& wanted) {
  std::unordered_set<std::string> candidates(wanted.begin(), wanted.end());
  if (wanted.empty()) {
    for (const LinkDescription& link : description.links) candidates.insert(link.name);
  }
  std::vector<std::string> names;
  const auto choose = [&](const std::string& name) {
    if (candidates.erase(name) > 0) names.push_back(name);
  };
  for (const std::string& name : description.link_order) choose(name);
  for (const std::string& name : wanted) choose(name);  // not in the URDF
  return names;
}

std::string link_counts(const ModelState& state) {
  std::size_t monitored = 0, packed = 0;
  for (const LinkModel& link : state.robot->links) packed += link.usable() ? 1 : 0;
  for (const std::size_t i : state.paired) packed -= state.robot->links[i].usable() ? 1 : 0;
  for (const std::size_t i : state.monitored) {
    monitored += state.robot->links[i].usable() ? 1 : 0;
  }
  const std::size_t broken = state.monitored.size() - monitored;
  std::string text = std::to_string(monitored) + " links monitored";
  if (broken > 0) {
    text += ", " + std::to_string(broken) + " UNKNOWN (its geometry cannot be used: see above)";
  }
  if (packed > monitored) {
    text += ", " + std::to_string(packed - monitored) + " more packed for the self-filter";
  }
  return text;
}

}  // namespace ist
