#pragma once

#include "internal/bvh/traversal_stack.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// The stack of a depth-first traversal of one Inner Sphere Tree.
template <typename Entry>
using SphereTreeStack = TraversalStack<Entry, stack_capacity(kMaxTreeLevels, kSphereWidth)>;

}  // namespace ist
