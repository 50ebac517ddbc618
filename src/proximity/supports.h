#pragma once

#include <cstdint>
#include <vector>

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

constexpr float kNowhere = -1e15F;  ///< [m] how far nothing reaches

/// How far the parts of a link reach along a direction: for each child of a node at least as far as
/// what of the link is in it; where the child is a leaf, at least to the centres of its spheres,
/// too. Found node by node, where a descent asks for it, and kept until the direction is another.
struct Supports {
  explicit Supports(const InnerSphereTree& tree)
      : reach(tree.nodes().size() * kSphereWidth, kNowhere), found(tree.nodes().size(), 0) {}

  /// @param n       unit vector in the link's frame
  /// @param link_reach  [m] how far the link's geometry itself reaches
  void aim(const float n[3], float link_reach) {
    for (int axis = 0; axis < 3; ++axis) normal[axis] = n[axis];
    most = link_reach;
    ++aims;
  }

  std::vector<float> reach;          ///< [m] kSphereWidth for each node
  std::vector<std::uint64_t> found;  ///< by node, for which of the aims; 0: there was none yet
  std::uint64_t aims = 0;
  float normal[3] = {};
  float most = 0.0F;
};

}  // namespace ist
