#include "support/demo_arm.h"

#include <fstream>
#include <sstream>
#include <string>

#include "support/sanitizers.h"

namespace ist::test {

RobotDescription demo_robot() {
  const std::string folder = IST_PROXIMITY_SOURCE_DIR;
  std::ifstream file(folder + "/demo/demo_arm.urdf");
  std::stringstream text;
  text << file.rdbuf();
  return parse_urdf(text.str(), GeometrySource::kCollision,
                    [folder](const std::string& /*package*/) { return folder; });
}

std::shared_ptr<const RobotModel> demo_model() {
  static const std::shared_ptr<const RobotModel> model = [] {
    RobotModelConfig config;
    config.packing.max_error = packed_to(config.packing.max_error);
    return build_robot_model(demo_robot(), config);
  }();
  return model;
}

}  // namespace ist::test
