#pragma once

#include <Eigen/Geometry>

#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Notes as free where a robot is: the voxels whose centres are in one of its solids, or no farther
/// from one than a skin. Cover spheres alone would not do: they reach centimetres out of a link, to
/// where nothing may have been seen.
/// @param robot  in the fixed frame F
/// @param X_MF   F -> the memory's frame
/// @param skin   [m]
/// @param now    [s]
/// @returns a box that holds robot and skin [m] in M; empty: there is no robot
Eigen::AlignedBox3d note_body(Span<const PosedSolid> robot, const Eigen::Isometry3d& X_MF,
                              double skin, double now, MemoryMap* body);

}  // namespace ist
