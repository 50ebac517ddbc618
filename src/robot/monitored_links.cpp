#include "monitored_links.h"

#include <unordered_map>
#include <unordered_set>

#include "internal/geometry/limits.h"

namespace ist {
namespace {

// The links of a description by name.
struct LinkIndex {
  explicit LinkIndex(const RobotDescription& robot)
      : without_geometry(robot.links_without_geometry.begin(), robot.links_without_geometry.end()) {
    for (const LinkDescription& link : robot.links) with_geometry.insert({link.name, &link});
  }
  std::unordered_map<std::string, const LinkDescription*> with_geometry;
  std::unordered_set<std::string> without_geometry;
};

MonitoredLink monitored(const RobotDescription& robot, const LinkIndex& index,
                        const std::string& name) {
  MonitoredLink link;
  link.name = name;
  const auto found = index.with_geometry.find(name);
  if (found != index.with_geometry.end()) {
    link.description = found->second;
    link.error = link.description->error;
    if (link.error.empty() && link.description->geometry.empty()) {
      link.error = "link '" + name + "' has no geometry";
    }
    for (const GeometryElement& element : link.description->geometry) {
      const std::string fault = link.error.empty() ? element_fault(element) : "";
      if (!fault.empty()) {
        link.error = "link '" + name + "', element '";
        link.error.append(element.source).append("': ").append(fault);
      }
    }
    return link;
  }
  if (index.without_geometry.count(name) > 0) {
    link.error = "link '" + name +
                 "' is to be monitored and has no geometry; give it a <collision> element or take "
                 "it from the list of links";
  } else {
    link.error = "link '" + name + "' is to be monitored and is not in the URDF of robot '" +
                 robot.name + "'; correct the list of links";
  }
  return link;
}

}  // namespace

std::vector<MonitoredLink> select_links(const RobotDescription& robot,
                                        const std::vector<std::string>& wanted) {
  const LinkIndex index(robot);
  std::vector<std::string> known = robot.link_order;
  if (known.empty()) {
    for (const LinkDescription& link : robot.links) known.push_back(link.name);
    known.insert(known.end(), robot.links_without_geometry.begin(),
                 robot.links_without_geometry.end());
  }
  const std::unordered_set<std::string> wanted_names(wanted.begin(), wanted.end());
  std::unordered_set<std::string> chosen;
  std::vector<MonitoredLink> links;
  const auto choose = [&](const std::string& name) {
    if (chosen.insert(name).second) links.push_back(monitored(robot, index, name));
  };
  for (const std::string& name : known) {
    const bool is_wanted =
        wanted.empty() ? index.without_geometry.count(name) == 0 : wanted_names.count(name) > 0;
    if (is_wanted) choose(name);
  }
  for (const std::string& name : wanted) choose(name);
  return links;
}

}  // namespace ist
