#pragma once

#include <memory>

#include "ist_proximity/robot/robot_model.h"

namespace ist::test {

/// The arm of the demo, with the shapes of its URDF.
RobotDescription demo_robot();

/// The arm's model, packed as the demo packs it; built once for all tests of a program.
std::shared_ptr<const RobotModel> demo_model();

}  // namespace ist::test
