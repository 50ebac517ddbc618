#include "proximity/coherence/link_bound.h"

#include <limits>

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

LinkBound::LinkBound(const LinkModel& link)
    : displacement_(link), least_cover_distance_(least_cover_distance(link)) {}

double LinkBound::least_cover_distance(const LinkModel& link) {
  return link.solid.is_closed() ? -kInfinity : link.tree.interior_gap();
}

void LinkBound::set_link(const LinkModel& link) {
  const double least = least_cover_distance(link);
  if (least > -kInfinity) cover_distance_ += least - least_cover_distance_;
  least_cover_distance_ = least;
  displacement_ = DisplacementBound(link);
}

void LinkBound::prove(SceneId scene, const Eigen::Isometry3d& X_FL, double bound,
                      double cover_distance, double max_coordinate) {
  X_FL_ = X_FL;
  bound_ = bound;
  cover_distance_ = cover_distance;
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
  if (least_cover_distance_ == -kInfinity) return true;
  return bound > 0.0 && stays_outside(cover_distance_, moved, least_cover_distance_);
}

double LinkBound::displacement_to(SceneId scene, const Eigen::Isometry3d& X_FL) const {
  if (scene == kUnknownScene || scene != scene_) return kInfinity;
  return displacement_.between(X_FL_, X_FL);
}

}  // namespace ist
