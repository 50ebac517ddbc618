#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// A region of space whose points are told apart from the others of a cloud: those of a target that
/// is to be grasped, or of a dock. See Ingest::set_zones().
struct Zone {
  /// The group of points that are in no zone.
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  Shape shape = Box{{1.0, 1.0, 1.0}};  ///< a box, cylinder or sphere in the zone's frame Z
  Eigen::Isometry3d X_FZ = Eigen::Isometry3d::Identity();  ///< Z -> fixed frame
  std::size_t group = 0;                                   ///< that its points go to
};

/// [m] How deep a point lies in a shape: inside, its distance from the surface; outside, negative,
/// and no farther from 0 than the distance from the shape. A mesh has no inside: -inf.
/// @param p_Z  [m] in the shape's frame
double depth_in(const Shape& shape, const Eigen::Vector3d& p_Z);

}  // namespace ist
