#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

constexpr float kNoSupport = -1e15F;  ///< [m] support of an unused slot

/// Support functions of the nodes of a link's tree along one direction n: for each child of a node,
/// no point x of the link's geometry in the child has a larger n.x; where the child is a leaf, no
/// sphere centre has either. They are computed node by node where a traversal first needs them, and
/// kept until the direction changes. One thread.
struct SupportCache {
  explicit SupportCache(const InnerSphereTree& tree)
      : support(tree.nodes().size() * kSphereWidth, kNoSupport),
        computed_for(tree.nodes().size(), 0) {}

  /// @param n             unit vector in the link's frame
  /// @param link_support  [m] support of the whole link along n
  void set_direction(const float n[3], float link_support) {
    for (int axis = 0; axis < 3; ++axis) normal[axis] = n[axis];
    max_support = link_support;
    ++direction_id;
  }

  std::size_t memory() const {  ///< [bytes]
    return support.capacity() * sizeof(float) + computed_for.capacity() * sizeof(std::uint64_t);
  }

  std::vector<float> support;               ///< [m] kSphereWidth for each node
  std::vector<std::uint64_t> computed_for;  ///< by node: a direction_id; 0: none
  std::uint64_t direction_id = 0;
  float normal[3] = {};
  float max_support = 0.0F;  ///< [m]
};

/// Parallel supporting planes of the parts of a link, in the frame O of an index: every point x of
/// a part satisfies normal . x <= offset + support, with the support of the part's node. So a point
/// p is at least normal . p - offset - support away from the part. Spheres alone bound poorly where
/// obstacles are flat and far: their caps above the plane are nearer than the part is.
struct SupportingPlanes {
  float normal[3] = {};                                   ///< unit; zero: there are no planes
  float offset = std::numeric_limits<float>::infinity();  ///< [m] rounded up; of the link's origin
};

}  // namespace ist
