#include "tree/inner_sphere_tree_builder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

// Slots without a child are at the origin, with a radius that makes them farther than anything.
constexpr float kNoRadius = -1e30F;
constexpr int kBoundingSphereSteps = 48;

// Inlining is forbidden: GCC 12 (-O2) vectorizes the conversion together with the one back to
// double into nothing, and the rounding is lost.
[[gnu::noinline]] Eigen::Vector3f to_float(const Eigen::Vector3d& p) { return p.cast<float>(); }

// A sphere in float: its inner sphere lies in the given one, its cover sphere holds the given one.
InnerSphere rounded(const InnerSphere& sphere) {
  const Eigen::Vector3d center = to_float(sphere.center).cast<double>();
  const double moved = (center - sphere.center).norm();
  return {center, round_down(sphere.radius - moved), round_up(sphere.cover_radius + moved)};
}

bool is_leaf(const SphereRange& range) {
  return size(range) <= static_cast<std::uint32_t>(kSphereWidth);
}

}  // namespace

InnerSphereTreeBuilder::InnerSphereTreeBuilder(const std::vector<InnerSphere>& spheres,
                                               std::vector<SphereNode>* nodes,
                                               std::vector<SphereLeaf>* leaves)
    : nodes_(*nodes),
      leaves_(*leaves),
      spheres_(spheres.size()),
      order_{&spheres_, std::vector<std::uint32_t>(spheres.size())} {
  std::transform(spheres.begin(), spheres.end(), spheres_.begin(), rounded);
  std::iota(order_.indices.begin(), order_.indices.end(), 0U);
}

// A small enclosing sphere: the center starts at the middle of the bounding box and moves toward
// the farthest sphere in ever shorter steps (Badoiu and Clarkson 2003); the radius is measured for
// each center.
InnerSphereTreeBuilder::BoundingSphere InnerSphereTreeBuilder::bounding_sphere(
    const SphereRange& range) const {
  Eigen::AlignedBox3d box;
  for (std::uint32_t i = range.first; i < range.second; ++i) {
    const InnerSphere& sphere = order_[i];
    box.extend(Eigen::Vector3d(sphere.center.array() - sphere.cover_radius));
    box.extend(Eigen::Vector3d(sphere.center.array() + sphere.cover_radius));
  }
  const auto radius_about = [&](const Eigen::Vector3d& center, const InnerSphere** farthest) {
    double radius = -1.0;
    for (std::uint32_t i = range.first; i < range.second; ++i) {
      const InnerSphere& candidate = order_[i];
      const double extent = (candidate.center - center).norm() + candidate.cover_radius;
      if (extent > radius) {
        radius = extent;
        *farthest = &candidate;
      }
    }
    return radius;
  };
  const InnerSphere* farthest = nullptr;
  Eigen::Vector3d center = box.center(), best = center;
  double smallest = radius_about(center, &farthest);
  for (int step = 1; step <= kBoundingSphereSteps && size(range) > 1; ++step) {
    const Eigen::Vector3d to_farthest = farthest->center - center;
    const double distance = to_farthest.norm();
    const double extent = distance + farthest->cover_radius;
    if (distance > 0.0) center += to_farthest / distance * (0.5 * extent / (step + 1));
    const double radius = radius_about(center, &farthest);
    if (radius < smallest) {
      smallest = radius;
      best = center;
    }
  }
  const Eigen::Vector3f rounded = to_float(best);
  return {rounded, radius_about(rounded.cast<double>(), &farthest)};
}

std::int32_t InnerSphereTreeBuilder::add_node(const SphereRange& range) {
  const auto index = static_cast<std::int32_t>(nodes_.size());
  nodes_.emplace_back();
  const std::vector<SphereRange> groups = split_at_medians(range, &order_);
  SphereNode node{};
  node.count = static_cast<std::int32_t>(groups.size());
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); ++k) {
    node.radius[k] = node.max_inner[k] = kNoRadius;
    if (k >= groups.size()) continue;
    const BoundingSphere sphere = bounding_sphere(groups[k]);
    node.x[k] = sphere.center.x();
    node.y[k] = sphere.center.y();
    node.z[k] = sphere.center.z();
    node.radius[k] = round_up(sphere.radius);
    for (std::uint32_t i = groups[k].first; i < groups[k].second; ++i) {
      node.max_inner[k] = std::max(node.max_inner[k], round_up(order_[i].radius));
    }
    node.child[k] = is_leaf(groups[k]) ? ~add_leaf(groups[k]) : add_node(groups[k]);
  }
  nodes_[static_cast<std::size_t>(index)] = node;
  return index;
}

std::int32_t InnerSphereTreeBuilder::add_leaf(const SphereRange& range) {
  SphereLeaf leaf{};
  leaf.count = static_cast<std::int32_t>(size(range));
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(kSphereWidth); ++k) {
    leaf.inner_radius[k] = leaf.cover_radius[k] = kNoRadius;
    if (range.first + k >= range.second) continue;
    const InnerSphere& sphere = order_[range.first + k];
    leaf.x[k] = static_cast<float>(sphere.center.x());
    leaf.y[k] = static_cast<float>(sphere.center.y());
    leaf.z[k] = static_cast<float>(sphere.center.z());
    leaf.inner_radius[k] = static_cast<float>(sphere.radius);
    leaf.cover_radius[k] = static_cast<float>(sphere.cover_radius);
  }
  leaves_.push_back(leaf);
  return static_cast<std::int32_t>(leaves_.size()) - 1;
}

}  // namespace ist
