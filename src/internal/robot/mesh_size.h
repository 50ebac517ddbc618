#pragma once

#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// One sentence for each mesh whose size suggests a wrong unit: a mesh in millimetres whose URDF
/// lacks scale="0.001 0.001 0.001", or one that is scaled twice. Users should read it before the
/// meshes are packed, which takes minutes.
/// @param links  the links to check; empty: all
std::vector<std::string> doubtful_sizes(const RobotDescription& robot,
                                        const std::vector<std::string>& links = {});

/// Names the joints that turn or slide and state no range of positions; those that follow another
/// joint need none.
/// @returns a sentence; empty: there are none
std::string doubtful_limits(const RobotDescription& robot);

}  // namespace ist
