#pragma once

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Whether a point is farther than `distance` [m] from all cover spheres of a tree.
/// @param nodes  nodes[0] is the root
/// @param p_L    [m] link frame
bool cover_distance_exceeds(const SphereNode* nodes, const SphereLeaf* leaves, const float p_L[3],
                            float distance);

}  // namespace ist
