#include "proximity/coherence/link_bound.h"

#include <limits>

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

LinkBound::LinkBound(const LinkModel& link)
    : displacement_(link),
      least_cover_distance_(!link.solid.is_closed() ? link.tree.interior_gap() : -kInfinity) {}

void LinkBound::prove(SceneId scene, const Eigen::Isometry3d& X_FL, double bound,
                      double cover_distance, double max_coordinate) {
  scene_ = bound > 0.0 && stays_outside(cover_distance, 0.0, least_cover_distance_) ? scene
                                                                                    : kUnknownScene;
  X_FL_ = X_FL;
  bound_ = bound;
  cover_distance_ = cover_distance;
  max_coordinate_ = max_coordinate;
}

double LinkBound::at(SceneId scene, const Eigen::Isometry3d& X_FL) const {
  const double moved = displacement_to(scene, X_FL);
  const double bound = after_displacement(bound_, moved);
  return bound > 0.0 && stays_outside(cover_distance_, moved, least_cover_distance_) ? bound
                                                                                     : -kInfinity;
}

double LinkBound::displacement_to(SceneId scene, const Eigen::Isometry3d& X_FL) const {
  if (scene == kUnknownScene || scene != scene_) return kInfinity;
  return displacement_.between(X_FL_, X_FL);
}

}  // namespace ist
