#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "pack_robot/input.h"

namespace ist::tools {

/// Draws the inner spheres of each model side by side into a PNG file: one colour a link, joint
/// positions 0, seen from the front left and above, without perspective.
/// @throws ModelError when the file cannot be written
void draw(const Input& input, const std::vector<std::shared_ptr<const RobotModel>>& models,
          const std::string& path);

}  // namespace ist::tools
