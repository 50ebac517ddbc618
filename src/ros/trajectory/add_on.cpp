#include "ros/add_ons/add_on.h"
#include "ros/trajectory/trajectory_watch.h"

namespace ist {

std::unique_ptr<AddOn> make_trajectory(const AddOnContext& node) {
  return std::make_unique<TrajectoryWatch>(node);
}

}  // namespace ist
