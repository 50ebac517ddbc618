#pragma once

#include <functional>
#include <string>

namespace ist {

/// The folder of a ROS package, or an empty string when it is not known.
using PackageFinder = std::function<std::string(const std::string& package)>;

/// Searches ROS_PACKAGE_PATH as rospack does (folders with a package.xml of that name), without
/// ROS.
PackageFinder environment_package_finder();

/// The file that `package://NAME/PATH`, `file:///PATH` or a plain absolute path names.
/// @throws ModelError naming the URI: unknown package (and what to do: ROS_PACKAGE_PATH), unknown
///         scheme, relative path.
std::string resolve_uri(const std::string& uri, const PackageFinder& find_package);

}  // namespace ist
