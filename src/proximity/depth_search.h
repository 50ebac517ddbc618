#pragma once

#include "proximity/link_query_state.h"

namespace ist {

/// Into so many parts a link's query may divide the boxes that overlap it; fewer for meshes with
/// holes, where parts bound little (Solid::distance_floor).
constexpr int kMaxBoxCells = 256, kMaxBoxCellsWithHoles = kMaxBoxCells / 8;
/// So many points a link's query may measure to find one inside where boxes seem only to touch it.
constexpr int kMaxDescentSteps = 128;

/// Searches the deepest point of solid boxes inside the link, after the dual-tree traversal has
/// refined what is outside: the obstacle is every point of a box. Unsigned distances do not prune
/// inside, where the deepest point is wanted; signed ones do: the signed distance at the centre of
/// a box bounds that of all its points. How much deeper another point can be than the deepest one
/// that was found, branch and bound over parts of boxes says. Results go to LinkSearch. Neither
/// allocates nor throws.
void search_depth(const BoxObstacles& obstacles, LinkQueryState* link);

}  // namespace ist
