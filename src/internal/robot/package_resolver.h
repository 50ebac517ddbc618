#pragma once

#include <string>

#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// The file that `package://NAME/PATH`, `file:///PATH` or a plain absolute path names.
/// @throws ModelError naming the URI: unknown package (and what to do: ROS_PACKAGE_PATH), unknown
///         scheme, relative path.
std::string resolve_uri(const std::string& uri, const PackageFinder& find_package);

}  // namespace ist
