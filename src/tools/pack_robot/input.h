#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist::tools {

/// The robot to pack, and the poses of its links for a picture.
struct Input {
  RobotDescription robot;  ///< a mesh is a robot of one link
  std::string urdf_path;   ///< empty for a mesh
  std::map<std::string, Eigen::Isometry3d>
      X_RL;  ///< by link: link -> root link, all joint positions 0
};

/// Reads a URDF (a name that ends in .urdf or .xml) or a mesh (any other name).
/// @param uri  a path, or a URI of file:// or package://
/// @param package_dirs  as RobotConfig
/// @throws ModelError naming the file and what is wrong
Input read_input(const std::string& uri, GeometrySource source,
                 const std::vector<std::string>& package_dirs);

}  // namespace ist::tools
