#pragma once

#include <memory>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "proximity/link_surface.h"

namespace ist {

struct RobotSurfaces {
  std::shared_ptr<const RobotModel> model;
  std::vector<std::shared_ptr<const LinkSurface>> surfaces;  ///< by link; null: not usable
};

}  // namespace ist
