#pragma once

#include <Eigen/Geometry>

#include "proximity/coherence/displacement.h"
#include "proximity/coherence/scene_tracker.h"

namespace ist {

/// A lower bound of a link's distance to a scene, kept for the poses to come (the invariant and its
/// exception are in displacement.h). The bound stays with the pose where it was proven, so
/// displacements do not add up.
class LinkBound {
 public:
  explicit LinkBound(const LinkModel& link);

  /// @param bound           [m] no stored point has a smaller signed distance; kept where positive,
  ///                        and of a closed solid
  /// @param outside_bound   [m] every place that is nearer to a stored point is outside
  /// @param max_coordinate  [m] of the link in the frame of an index, for the error of stored
  /// points
  void prove(SceneId scene, const Eigen::Isometry3d& X_FL, double bound, double outside_bound,
             double max_coordinate);
  void forget() { scene_ = kUnknownScene; }

  /// Takes another packing of the same geometry; what is proven stays.
  void set_link(const LinkModel& link);

  /// [m] No stored point has a smaller signed distance from the link at this pose; -inf: nothing is
  /// proven.
  double at(SceneId scene, const Eigen::Isometry3d& X_FL) const;

  /// [m] How far the link may have moved since the bound was proven; inf: nothing is proven.
  double displacement_to(SceneId scene, const Eigen::Isometry3d& X_FL) const;

  /// [m] As given to prove().
  double max_coordinate() const { return max_coordinate_; }

 private:
  bool holds(double bound, double moved) const;

  DisplacementBound displacement_;
  bool is_closed_;
  SceneId scene_ = kUnknownScene;
  Eigen::Isometry3d X_FL_ = Eigen::Isometry3d::Identity();
  double bound_ = 0.0, outside_bound_ = 0.0, max_coordinate_ = 0.0;
};

}  // namespace ist
