#pragma once

#include <fstream>
#include <memory>
#include <sstream>
#include <string>

#include "ist_proximity/robot/robot_model.h"
#include "support/sanitizers.h"

namespace ist::test {

/// The arm of the demo, with the shapes of its URDF.
inline RobotDescription demo_robot() {
  const std::string folder = IST_PROXIMITY_SOURCE_DIR;
  std::ifstream file(folder + "/demo/demo_arm.urdf");
  std::stringstream text;
  text << file.rdbuf();
  return parse_urdf(text.str(), GeometrySource::kCollision,
                    [folder](const std::string& /*package*/) { return folder; });
}

/// The arm's model, packed as the demo packs it; built once for all tests of a program.
inline std::shared_ptr<const RobotModel> demo_model() {
  static const std::shared_ptr<const RobotModel> model = [] {
    RobotModelConfig config;
    config.packing.max_error = packed_to(config.packing.max_error);
    return build_robot_model(demo_robot(), config);
  }();
  return model;
}

}  // namespace ist::test
