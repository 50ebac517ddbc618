#pragma once

#include <Eigen/Geometry>
#include <limits>

#include "proximity/coherence/displacement.h"
#include "proximity/coherence/scene_tracker.h"

namespace ist {

/// A lower bound of a link's distance to the spheres that a scene's obstacles stand for
/// (PointExtent), kept for the poses to come. It is that of obstacles which are outside the link,
/// less their radii, so that it may be negative; it serves at poses where all of them are outside.
class ExtentBound {
 public:
  explicit ExtentBound(const LinkModel& link) : displacement_(link) {}

  void prove(SceneId scene, const Eigen::Isometry3d& X_FL, double bound) {
    scene_ = scene;
    X_FL_ = X_FL;
    bound_ = bound;
  }
  void forget() { scene_ = kUnknownScene; }
  /// Takes another packing of the same geometry; what is proven stays.
  void set_link(const LinkModel& link) { displacement_ = DisplacementBound(link); }

  /// [m] -inf: nothing is proven.
  double at(SceneId scene, const Eigen::Isometry3d& X_FL) const {
    if (scene == kUnknownScene || scene != scene_) return -std::numeric_limits<double>::infinity();
    return after_displacement(bound_, displacement_.between(X_FL_, X_FL));
  }

 private:
  DisplacementBound displacement_;
  SceneId scene_ = kUnknownScene;
  Eigen::Isometry3d X_FL_ = Eigen::Isometry3d::Identity();
  double bound_ = 0.0;
};

}  // namespace ist
