#pragma once

#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist::test {

/// A robot of links without joints, named link0, link1 and so on.
RobotDescription robot_of(const std::vector<LinkGeometry>& links);

}  // namespace ist::test
