#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>

#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/robot/robot_model.h"
#include "proximity/first_bound.h"

namespace ist {

/// Supporting planes of a link, posed in the frame O of an index: the link is below each of them.
class SeparatingPlanes {
 public:
  static constexpr int kMax = 16;

  SeparatingPlanes(const LinkModel& link, const Eigen::Isometry3d& X_OL)
      : link_(link), X_OL_(X_OL) {}

  /// Adds the plane across a direction. It costs as much as an exact distance or less.
  /// @param direction_O  not zero, from the link to what is to be above
  void add(const Eigen::Vector3d& direction_O);

  /// A plane holds the points with n.x = offset.
  struct Plane {
    std::array<float, 3> normal;
    float offset;  ///< [m]
  };
  int count() const { return count_; }
  const Plane& plane(int i) const { return planes_[static_cast<std::size_t>(i)]; }

 private:
  const LinkModel& link_;
  const Eigen::Isometry3d& X_OL_;
  std::array<Plane, kMax> planes_;
  int count_ = 0;
};

/// Nodes that bound_by_planes() divides, tiles that it looks into, and planes that it makes.
constexpr int kMaxSeparationSteps = 96;

/// The input of bound_by_planes(), for an index of points or of boxes.
template <class Bvh>
struct SeparationInput {
  const PosedSpheres* spheres;
  float gap;     ///< [m] obstacles that are farther from the spheres are outside the link
  float radius;  ///< [m] of the link: planes are made for boxes that are no larger
  const Bvh* bvh;
  int max_steps = kMaxSeparationSteps, max_planes = SeparatingPlanes::kMax;
  double late = 0.0;  ///< [s] the deadline may be exceeded by so much
};

/// A lower bound of the signed distance between a link and all obstacles of an index, by
/// spheres and supporting planes: the boxes with the least bounds get a plane of their own, or are
/// divided. It takes up to some dozens of microseconds. A body that is nearly convex is separated
/// from obstacles that are much nearer than its spheres are fine.
/// @param planes    where those that are made are added
/// @param deadline  asked before each step; null: none
/// @returns [m] rounding of the link's pose is not taken off; 0 or less where an obstacle may be
///          inside
float bound_by_planes(const SeparationInput<PointBvh>& input, SeparatingPlanes* planes,
                      Deadline* deadline);
float bound_by_planes(const SeparationInput<BoxBvh>& input, SeparatingPlanes* planes,
                      Deadline* deadline);

}  // namespace ist
