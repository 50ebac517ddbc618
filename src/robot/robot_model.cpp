#include "ist_proximity/robot/robot_model.h"

#include "internal/robot/anytime_model.h"

namespace ist {

bool same_geometry(const RobotModel& a, const RobotModel& b) {
  return &a == &b || (a.geometry_id != 0 && a.geometry_id == b.geometry_id);
}

std::shared_ptr<const RobotModel> build_robot_model(const RobotDescription& description,
                                                    const RobotModelConfig& config,
                                                    const RobotModelCallbacks& callbacks) {
  // The description outlives this call, and the result does not need it.
  const std::shared_ptr<const RobotDescription> borrowed(std::shared_ptr<void>(), &description);
  const auto built = AnytimeModel::build(borrowed, config, AnytimeModel::Stage::kFinal, callbacks);
  return built ? built->robot() : nullptr;
}

}  // namespace ist
