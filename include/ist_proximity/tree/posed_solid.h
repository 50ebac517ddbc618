#pragma once

#include <Eigen/Geometry>

#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// One link's geometry at a pose, for whatever needs to know where a robot is but not what a robot
/// is. The same link at several instants is as many of them.
struct PosedSolid {
  const InnerSphereTree* tree = nullptr;  ///< in the link frame L; not owned, not null
  const Solid* solid = nullptr;           ///< exact geometry in L; not owned, not null
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();  ///< link frame -> fixed frame, rigid
};

}  // namespace ist
