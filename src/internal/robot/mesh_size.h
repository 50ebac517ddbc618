#pragma once

#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// One sentence for each mesh whose size speaks of a wrong unit: a mesh in millimetres whose URDF
/// forgets scale="0.001 0.001 0.001", or one that is scaled twice. To be told before they
/// are packed, which takes minutes.
/// @param links  the links to look at; empty: all
std::vector<std::string> doubtful_sizes(const RobotDescription& robot,
                                        const std::vector<std::string>& links = {});

}  // namespace ist
