#pragma once

#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist::test {

/// A robot of links without joints, named link0, link1 and so on.
inline RobotDescription robot_of(const std::vector<LinkGeometry>& links) {
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
