#include "ist_proximity/tree/inner_sphere_tree.h"

#include <algorithm>
#include <limits>

#include "internal/geometry/float_rounding.h"
#include "internal/tree/sphere_lanes.h"
#include "internal/tree/sphere_tree_stack.h"
#include "tree/cover_distance_kernel.h"
#include "tree/inner_sphere_tree_builder.h"

namespace ist {
namespace {

// The distances [m] of a point to the spheres of a node or a leaf.
template <typename Spheres>
SphereLanes sphere_distances(const Spheres& spheres, const float* radius,
                             const Eigen::Vector3f& p) {
  const auto row = [](const float* values) { return Eigen::Map<const SphereLanes>(values); };
  return ((row(spheres.x) - p.x()).square() + (row(spheres.y) - p.y()).square() +
          (row(spheres.z) - p.z()).square())
             .sqrt() -
         row(radius);
}

}  // namespace

InnerSphereTree::InnerSphereTree(const Packing& packing)
    : interior_gap_(packing.certificate.interior_gap), sphere_count_(packing.spheres.size()) {
  if (packing.spheres.empty()) return;
  InnerSphereTreeBuilder builder(packing.spheres, &nodes_, &leaves_);
  const InnerSphereTreeBuilder::BoundingSphere root = builder.bounding_sphere(builder.all());
  center_ = root.center.cast<double>();
  radius_ = round_up(root.radius);
  builder.run();
}

double InnerSphereTree::inner_distance(const Eigen::Vector3d& p_L) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const SphereLeaf& leaf : leaves_) {
    for (int k = 0; k < leaf.count; ++k) {
      const Eigen::Vector3d center(leaf.x[k], leaf.y[k], leaf.z[k]);
      nearest =
          std::min(nearest, (p_L - center).norm() - static_cast<double>(leaf.inner_radius[k]));
    }
  }
  return nearest;
}

// Float loses this much [m] in the point, in the differences of coordinates and in the root.
double InnerSphereTree::rounding(const Eigen::Vector3d& p_L) const {
  return 1e-6 * (p_L.cwiseAbs().maxCoeff() + radius_ + center_.norm());
}

double InnerSphereTree::cover_distance(const Eigen::Vector3d& p_L, double stop_below,
                                       double coarse) const {
  if (nodes_.empty()) return std::numeric_limits<double>::infinity();
  const Eigen::Vector3f p = p_L.cast<float>();
  const double rounding = this->rounding(p_L);
  struct Entry {
    std::int32_t child;
    float lower_bound;
  };
  SphereTreeStack<Entry> stack;
  stack.push({0, -std::numeric_limits<float>::max()});
  float nearest = std::numeric_limits<float>::infinity();
  while (!stack.empty() && static_cast<double>(nearest) - rounding >= stop_below) {
    const Entry entry = stack.pop();
    if (entry.lower_bound >= nearest) continue;
    if (entry.child < 0) {
      const SphereLeaf& leaf = leaves_[static_cast<std::size_t>(~entry.child)];
      nearest = std::min(nearest, sphere_distances(leaf, leaf.cover_radius, p).minCoeff());
      continue;
    }
    const SphereNode& node = nodes_[static_cast<std::size_t>(entry.child)];
    const SphereLanes distance = sphere_distances(node, node.radius, p);
    const std::size_t first = stack.size();
    for (int k = 0; k < node.count; ++k) {
      if (distance[k] >= nearest) continue;
      if (static_cast<double>(node.radius[k]) <= coarse) {
        nearest = distance[k];
      } else {
        stack.push_least_on_top<&Entry::lower_bound>(first, {node.child[k], distance[k]});
      }
    }
  }
  return static_cast<double>(nearest) - rounding;
}

bool InnerSphereTree::cover_distance_exceeds(const Eigen::Vector3d& p_L, double distance) const {
  if (nodes_.empty()) return true;
  const Eigen::Vector3f p = p_L.cast<float>();
  return ist::cover_distance_exceeds(nodes_.data(), leaves_.data(), p.data(),
                                     static_cast<float>(distance + rounding(p_L)));
}

}  // namespace ist
