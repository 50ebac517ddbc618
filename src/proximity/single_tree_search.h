#pragma once

#include "proximity/link_query_state.h"

namespace ist {

/// Branch and bound over the boxes of an index, with bounds of signed distances to the whole link:
/// the single-tree traversal (Gray and Moore 2000). Near the link, and inside, it is better than
/// the dual-tree traversal, since the link's grid bounds more tightly than cover spheres. The
/// bounds are kept for the poses to come, also those of what is inside (NodeBounds).
///
/// For a closed link it finds the closest point, or the deepest. For a mesh with holes it finds the
/// deepest of the points inside, and leaves those that are certainly outside to the dual-tree
/// traversal. Results go to LinkSearch. Neither allocates nor throws.
/// @returns false: the deadline passed first; what is known by then still holds
bool search_single_tree(const PointObstacles& obstacles, LinkQueryState* link);

}  // namespace ist
