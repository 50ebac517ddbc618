#include "contact/inner_sphere_depth.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "internal/bvh/traversal_stack.h"
#include "internal/tree/sphere_lanes.h"

namespace ist {
namespace {

struct Entry {
  std::int32_t child;
  float bound;  // [m] no sphere below is entered deeper
};

SphereLanes distances(const Eigen::Vector3f& p, const float* x, const float* y, const float* z) {
  const SphereLanes dx = p.x() - SphereLaneMap(x), dy = p.y() - SphereLaneMap(y),
                    dz = p.z() - SphereLaneMap(z);
  return (dx * dx + dy * dy + dz * dz).sqrt();
}

}  // namespace

double depth_in_spheres(const InnerSphereTree& tree, const Eigen::Vector3d& p_L, double floor,
                        double sufficient) {
  if (tree.empty()) return floor;
  const Eigen::Vector3f p = p_L.cast<float>();
  auto deepest = static_cast<float>(floor);
  const auto stop = static_cast<float>(sufficient);
  TraversalStack<Entry, stack_capacity(kMaxTreeLevels, kSphereWidth)> stack;
  stack.push({0, std::numeric_limits<float>::infinity()});
  while (!stack.empty()) {
    const Entry entry = stack.pop();
    if (!(entry.bound > deepest)) continue;
    if (entry.child < 0) {
      const SphereLeaf& leaf = tree.leaves()[static_cast<std::size_t>(~entry.child)];
      const SphereLanes depth =
          SphereLaneMap(leaf.inner_radius) - distances(p, leaf.x, leaf.y, leaf.z);
      deepest = std::max(deepest, depth.maxCoeff());
      if (deepest > stop) break;
      continue;
    }
    const SphereNode& node = tree.nodes()[static_cast<std::size_t>(entry.child)];
    const SphereLanes bound = (SphereLaneMap(node.radius) - distances(p, node.x, node.y, node.z))
                                  .min(SphereLaneMap(node.max_inner));
    const std::size_t first = stack.size();
    for (int k = 0; k < node.count; ++k) {
      if (bound[k] > deepest) {
        stack.push_greatest_on_top<&Entry::bound>(first, {node.child[k], bound[k]});
      }
    }
  }
  return static_cast<double>(deepest);
}

}  // namespace ist
