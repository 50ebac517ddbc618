#pragma once

#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// The packages of a URDF that is a file: folders named as the package in one of `package_dirs`, or
/// one of these itself; then environment_package_finder(). The package "" is the file's folder.
/// @param urdf_file  its path; empty: the URDF is no file
PackageFinder file_package_finder(const std::string& urdf_file,
                                  const std::vector<std::string>& package_dirs = {});

/// The file that `package://NAME/PATH`, `file:///PATH` or a plain absolute path names; a relative
/// path starts from find_package("").
/// @throws ModelError naming the URI: unknown package (and what to do), unknown scheme, a relative
///         path where nothing is known that it could start from.
std::string resolve_uri(const std::string& uri, const PackageFinder& find_package);

}  // namespace ist
