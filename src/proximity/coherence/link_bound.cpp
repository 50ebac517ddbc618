#include "proximity/coherence/link_bound.h"

#include "internal/geometry/numbers.h"

namespace ist {
LinkBound::LinkBound(const LinkModel& link)
    : displacement_(link), is_closed_(link.solid.is_closed()) {}

void LinkBound::set_link(const LinkModel& link) { displacement_ = DisplacementBound(link); }

void LinkBound::prove(SceneId scene, const Eigen::Isometry3d& X_FL, double bound,
                      double outside_bound, double max_coordinate) {
  X_FL_ = X_FL;
  bound_ = bound;
  outside_bound_ = outside_bound;
  max_coordinate_ = max_coordinate;
  scene_ = holds(bound, 0.0) ? scene : kUnknownScene;
}

double LinkBound::at(SceneId scene, const Eigen::Isometry3d& X_FL) const {
  const double moved = displacement_to(scene, X_FL);
  const double bound = after_displacement(bound_, moved);
  return holds(bound, moved) ? bound : -kInfinity;
}

// The signed distance of a closed solid changes by no more than the way inside as well. Near holes
// it jumps.
bool LinkBound::holds(double bound, double moved) const {
  return is_closed_ || (bound > 0.0 && after_displacement(outside_bound_, moved) > 0.0);
}

double LinkBound::displacement_to(SceneId scene, const Eigen::Isometry3d& X_FL) const {
  if (scene == kUnknownScene || scene != scene_) return kInfinity;
  return displacement_.between(X_FL_, X_FL);
}

}  // namespace ist
