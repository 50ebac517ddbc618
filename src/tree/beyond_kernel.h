#pragma once

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Whether a point is farther from all cover spheres than a margin [m].
/// @param nodes   nodes[0] is the root
/// @param p_L     [m] link frame
bool cover_distance_exceeds_spheres(const SphereNode* nodes, const SphereLeaf* leaves,
                                    const float p_L[3], float margin);

}  // namespace ist
