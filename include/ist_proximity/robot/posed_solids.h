#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/robot/robot_model.h"
#include "ist_proximity/tree/posed_solid.h"

namespace ist {

/// The links of a robot at their poses, as Ingest takes them for its self-filter. Links of unknown
/// pose, with an error or without spheres are left out.
/// @param model  viewed by the result, which must not outlive it
/// @param X_FL   by link: link frame -> fixed frame, rigid where known; a link beyond the end of
///               this or of `known` is of unknown pose
/// @param known  by link: whether the pose is known
std::vector<PosedSolid> posed_solids(const RobotModel& model, Span<const Eigen::Isometry3d> X_FL,
                                     const std::vector<bool>& known);

/// The same, appended to `solids`: allocates nothing where its capacity is enough. Several calls
/// collect a robot at several instants.
void append_posed_solids(const RobotModel& model, Span<const Eigen::Isometry3d> X_FL,
                         const std::vector<bool>& known, std::vector<PosedSolid>* solids);

}  // namespace ist
