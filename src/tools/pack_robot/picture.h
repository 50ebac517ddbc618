#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "pack_robot/input.h"

namespace ist::tools {

/// Draws the inner spheres of each model side by side into a PNG file. Every link has its colour
/// and all joint positions are 0. The view is orthographic, from the front left and above.
/// @throws ModelError when the file cannot be written
void draw(const Input& input, const std::vector<std::shared_ptr<const RobotModel>>& models,
          const std::string& path);

}  // namespace ist::tools
