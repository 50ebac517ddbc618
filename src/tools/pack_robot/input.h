#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>

#include "ist_proximity/robot/robot_description.h"

namespace ist::tools {

/// What is to be packed, and where its links are for a picture.
struct Input {
  RobotDescription robot;                         ///< a mesh is a robot of one link
  std::map<std::string, Eigen::Isometry3d> X_RL;  ///< link -> root, all joint positions 0
};

/// Reads a URDF (what ends in .urdf or .xml) or a mesh (anything else).
/// @param uri  a path, or a URI of file:// or package://
/// @throws ModelError naming the file and what is wrong
Input read_input(const std::string& uri, GeometrySource source);

}  // namespace ist::tools
