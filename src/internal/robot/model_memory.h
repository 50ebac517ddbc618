#pragma once

#include <cstddef>

#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Memory of a model by its parts [bytes]. Links that share a solid count it once each.
struct ModelMemory {
  std::size_t packings = 0;  ///< spheres with their certificates
  std::size_t trees = 0;
  std::size_t solids = 0;  ///< exact geometry with its hierarchies
  std::size_t fields = 0;  ///< distances about the links

  std::size_t total() const { return packings + trees + solids + fields; }
};

ModelMemory memory_of(const RobotModel& model);

}  // namespace ist
