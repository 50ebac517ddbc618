#include "ros/model/link_choice.h"

#include <algorithm>
#include <set>

#include "ros/common/text.h"
#include "ros/model/model_state.h"

namespace ist {
namespace {

bool holds(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string around(const CoarseHull& hull) { return hull.link + " (around " + hull.enclosed + ")"; }

bool has_enabled_pair(const CollisionRules& rules, const std::string& link) {
  return std::any_of(rules.enabled.begin(), rules.enabled.end(), [&](const auto& pair) {
    return (pair.first == link || pair.second == link) && rules.enables(pair.first, pair.second);
  });
}

// The SRDF says that the hull is for planning, and that the finer link is what collides.
bool is_off(const CollisionRules& rules, const CoarseHull& hull) {
  return rules.off.count(hull.link) > 0 && rules.off.count(hull.enclosed) == 0;
}

void leave_out_hulls(const CollisionRules& rules, const std::vector<CoarseHull>& hulls,
                     LinkChoice* choice, std::vector<std::string>* remarks) {
  std::vector<std::string> told, left_out;
  for (const CoarseHull& hull : hulls) {
    if (!is_off(rules, hull) || holds(left_out, hull.link)) continue;
    left_out.push_back(hull.link);
    told.push_back(around(hull));
    if (has_enabled_pair(rules, hull.link)) choice->paired.push_back(hull.link);
    const auto end = choice->monitored.end();
    choice->monitored.erase(std::remove(choice->monitored.begin(), end, hull.link), end);
  }
  if (told.empty()) return;
  remarks->push_back(
      "coarse hulls that the SRDF disables by default are neither monitored nor filter clouds: " +
      join(told, ", ") + "; where they are real parts of the robot, name all links in ~links" +
      (choice->paired.empty() ? "" : "; ~self_proximity watches the pairs that the SRDF enables"));
}

// The finer link of a hull, which is no hull itself; empty: the link is no hull.
std::string finest(const std::vector<CoarseHull>& hulls, const std::string& link) {
  const auto is_hull = [&](const std::string& name) {
    return std::any_of(hulls.begin(), hulls.end(),
                       [&](const CoarseHull& one) { return one.link == name && one.is_below; });
  };
  for (const CoarseHull& hull : hulls) {
    if (hull.link == link && hull.is_below && !is_hull(hull.enclosed)) return hull.enclosed;
  }
  return "";
}

void filter_as_monitored(const std::vector<CoarseHull>& hulls, LinkChoice* choice) {
  std::vector<std::string> told;
  for (const std::string& link : choice->monitored) {
    const std::string finer = finest(hulls, link);
    add_name(finer.empty() ? link : finer, &choice->filtering);
    if (!finer.empty()) told.push_back(link + " (around " + finer + ")");
  }
  if (told.empty()) return;
  choice->warnings.push_back(
      "links that are monitored and drawn around finer ones do not filter clouds: " +
      join(told, ", ") +
      "; where they are no real parts of the robot, leave them out of ~links, and where they are, "
      "name all links that filter in ~self_filter_links");
}

void warn_of_unknown_names(const RobotDescription& robot, const ServerConfig& config,
                           LinkChoice* choice) {
  const auto warn = [&](const std::string& parameter, const std::string& name) {
    if (holds(robot.link_order, name)) return;
    choice->warnings.push_back(parameter + " names '" + name + "', which is no link of the URDF");
  };
  for (const std::string& name : config.self_filter_links) warn("~self_filter_links", name);
  std::set<std::string> padded;
  for (const SourceConfig& source : config.sources) {
    for (const auto& [name, padding] : source.link_paddings) padded.insert(name);
  }
  for (const std::string& name : padded) warn("self_filter_padding", name);
}

bool any_self_filter(const std::vector<SourceConfig>& sources) {
  return std::any_of(sources.begin(), sources.end(),
                     [](const SourceConfig& source) { return source.ingest.self_filter; });
}

void choose_filtering(const RobotDescription& robot, const std::vector<CoarseHull>& hulls,
                      const ServerConfig& config, LinkChoice* choice,
                      std::vector<std::string>* remarks) {
  const std::vector<std::string> all = monitored_links(robot, {});
  if (config.self_filter_all) choice->filtering = all;
  for (const std::string& name : config.self_filter_links) {
    if (holds(all, name)) choice->filtering.push_back(name);
  }
  if (!config.self_filter_all && config.self_filter_links.empty()) {
    filter_as_monitored(hulls, choice);
  }
  warn_of_unknown_names(robot, config, choice);
  std::vector<std::string> others;
  for (const std::string& name : all) {
    const bool is_hull = std::any_of(hulls.begin(), hulls.end(),
                                     [&](const CoarseHull& hull) { return hull.link == name; });
    if (!is_hull && !holds(choice->filtering, name)) others.push_back(name);
  }
  if (others.empty()) return;
  remarks->push_back("self-filters leave points on these links in the clouds: " +
                     join(others, ", ") + "; ~self_filter_links chooses");
}

}  // namespace

void add_name(const std::string& name, std::vector<std::string>* names) {
  if (!holds(*names, name)) names->push_back(name);
}

std::vector<std::string> LinkChoice::packed() const {
  std::vector<std::string> links = monitored;
  for (const std::string& name : paired) add_name(name, &links);
  for (const std::string& name : filtering) add_name(name, &links);
  return links;
}

LinkChoice choose_links(const RobotDescription& robot, const CollisionRules& rules,
                        const std::vector<CoarseHull>& hulls, const ServerConfig& config) {
  LinkChoice choice;
  std::vector<std::string> remarks;
  choice.monitored = monitored_links(robot, config.model.links);
  if (config.model.links.empty()) leave_out_hulls(rules, hulls, &choice, &remarks);
  if (any_self_filter(config.sources)) choose_filtering(robot, hulls, config, &choice, &remarks);
  choice.remarks = join(remarks, "; ");
  return choice;
}

}  // namespace ist
