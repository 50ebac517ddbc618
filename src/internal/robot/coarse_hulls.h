#pragma once

#include <string>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// A link that is drawn around another one, for planning. What is between both is no part of the
/// robot.
struct CoarseHull {
  std::string link;
  std::string enclosed;   ///< the finer link
  bool is_below = false;  ///< fixed joints lead to the hull from the finer link
};

/// Finds the links that hold most of another one's surface, are of its size, no finer, and fixed to
/// it. A link that the enclosed one is fixed to (a hand, of a finger) is no hull: it is where the
/// enclosed one is mounted.
/// @throws Cancelled
std::vector<CoarseHull> coarse_hulls(const RobotDescription& robot, const CancelRequest& cancelled);

}  // namespace ist
