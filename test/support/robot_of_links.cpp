#include "support/robot_of_links.h"

#include <string>
#include <utility>

namespace ist::test {

RobotDescription robot_of(const std::vector<LinkGeometry>& links) {
  RobotDescription description;
  for (const LinkGeometry& geometry : links) {
    LinkDescription link;
    link.name = "link" + std::to_string(description.links.size());
    link.geometry = geometry;
    description.links.push_back(std::move(link));
  }
  return description;
}

}  // namespace ist::test
