#include "ist_proximity/robot/link_poses.h"

#include <algorithm>

namespace ist {

PosedSolid posed_solid(const LinkModel& link, const Eigen::Isometry3d& X_FL) {
  PosedSolid posed;
  posed.tree = &link.tree;
  posed.solid = &link.solid;
  posed.X_FL = X_FL;
  posed.field = link.field.get();
  return posed;
}

std::vector<PosedSolid> posed_solids(const RobotModel& model, Span<const Eigen::Isometry3d> X_FL,
                                     const std::vector<bool>& known) {
  std::vector<PosedSolid> solids;
  append_posed_solids(model, X_FL, known, &solids);
  return solids;
}

void append_posed_solids(const RobotModel& model, Span<const Eigen::Isometry3d> X_FL,
                         const std::vector<bool>& known, std::vector<PosedSolid>* solids) {
  const std::size_t count = std::min({model.links.size(), known.size(), X_FL.size()});
  for (std::size_t i = 0; i < count; ++i) {
    const LinkModel& link = model.links[i];
    if (!known[i] || !link.usable() || link.tree.empty()) continue;
    solids->push_back(posed_solid(link, X_FL[i]));
  }
}

}  // namespace ist
