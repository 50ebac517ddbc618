#include "contact/overlap_weight.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "contact/lens.h"
#include "internal/bvh/box_node.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/cloud/point_bvh.h"
#include "ist_proximity/contact/contact_volume.h"

namespace ist {
namespace {

// Sixteen numbers side by side; Eigen turns them into SIMD, square roots included.
using PointLanes = Eigen::Array<float, kPointWidth, 1>;
using PointLaneMap = Eigen::Map<const PointLanes, Eigen::Aligned16>;

// Leaves between two looks at the clock, where their points have been thinned before.
constexpr std::uint32_t kLeavesBetweenLooks = 16;

PointLanes squared_distance(const BoxNode& node, const Eigen::Vector3f& p) {
  const auto gap = [](const float* min, const float* max, float v) {
    return PointLanes((PointLaneMap(min) - v).max(v - PointLaneMap(max)).max(0.0F));
  };
  const PointLanes x = gap(node.min_x, node.max_x, p.x());
  const PointLanes y = gap(node.min_y, node.max_y, p.y());
  const PointLanes z = gap(node.min_z, node.max_z, p.z());
  return x * x + y * y + z * z;
}

// The volumes of the lenses between sixteen spheres of radius R and one of radius r, summed; over
// pi / 12. Unused slots are far away and add nothing.
float lens_sum(const PointTile& tile, const Eigen::Vector3f& p, float R, float r) {
  const PointLanes x = p.x() - PointLaneMap(tile.x), y = p.y() - PointLaneMap(tile.y),
                   z = p.z() - PointLaneMap(tile.z);
  const Lens<PointLanes> lens(PointLanes::Constant(R + r), PointLanes::Constant(R - r),
                              (x * x + y * y + z * z).sqrt());
  return (lens.thickness.square() * lens.factor).sum();
}

// Adds those of all points of a thinned cloud to `sum`, until the deadline.
void add_lenses(const ThinnedCloud& cloud, const Eigen::Vector3f& p, float R, float r,
                Deadline* deadline, float* sum) {
  if (cloud.empty()) return;
  const float touch_sq = (R + r) * (R + r);
  ThinnedNode buffer;
  TraversalStack<std::int32_t, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack;
  stack.push(cloud.root());
  while (!stack.empty()) {
    const std::int32_t child = stack.pop();
    const BoxNode& node = cloud.nodes()[static_cast<std::size_t>(child)];
    if (ThinnedCloud::is_leaf(node)) {
      const bool is_costly = !cloud.is_stored(child);
      if (deadline->passed_now_and_then(is_costly ? 1 : kLeavesBetweenLooks)) return;
      for (const ThinnedTile& tile : cloud.tiles(child, &buffer)) *sum += lens_sum(tile, p, R, r);
      continue;
    }
    const PointLanes squared = squared_distance(node, p);
    for (int k = 0; k < node.count; ++k) {
      if (squared[k] < touch_sq) stack.push(node.child[k]);
    }
  }
}

}  // namespace

double point_sphere_radius(const CloudSnapshot& cloud) {
  return kPointSphereRadius * cloud.thinning;
}

double overlap_weight(const Eigen::Vector3d& p_F, double radius, SnapshotSpan clouds,
                      Deadline* deadline) {
  const auto r = static_cast<float>(radius);
  float sum = 0.0F;
  for (const CloudSnapshot* cloud : clouds) {
    const ThinnedCloud thinned = cloud->index.bvh().thinned();
    const auto R = static_cast<float>(point_sphere_radius(*cloud));
    const Eigen::Vector3f p =
        (thinned.X_FO().linear().transpose() * (p_F - thinned.X_FO().translation())).cast<float>();
    add_lenses(thinned, p, R, r, deadline, &sum);
    if (deadline->has_passed()) return 0.0;
  }
  const float own = 16.0F * r * r * r;                   // the sphere's own volume, over pi / 12
  return static_cast<double>(own / std::max(sum, own));  // rounding could make its own lens less
}

}  // namespace ist
