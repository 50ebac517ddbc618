#pragma once

#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// A link to monitor; without a description it stays UNKNOWN, with `error`.
struct MonitoredLink {
  std::string name;
  const LinkDescription* description = nullptr;  ///< not owned
  std::string error;
};

/// The monitored links in the URDF's order; names that it lacks come last.
/// @param robot   outlives the result
/// @param wanted  names; empty: every link that has geometry
std::vector<MonitoredLink> select_links(const RobotDescription& robot,
                                        const std::vector<std::string>& wanted);

}  // namespace ist
