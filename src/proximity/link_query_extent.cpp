// The lower bound where obstacles have an extent: each stands for a sphere about it.

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "internal/bvh/traversal_stack.h"
#include "internal/geometry/numbers.h"
#include "proximity/extent_measure.h"
#include "proximity/link_query.h"
#include "proximity/search.h"

namespace ist {
namespace {

// Fronts of spheres and of points of one index are different fronts.
constexpr std::uint64_t kExtentFront = std::uint64_t{1} << 63U;

template <class Obstacles>
constexpr bool is_points = std::is_same_v<Obstacles, const PointObstacles&>;

// [m] The range of a query without extents.
double own_range(const LinkSearch& search) {
  return search.config.max_distance + search.config.margin;
}

bool has_extent(const CloudSnapshot& cloud) {
  return !cloud.extent.is_zero() || cloud.box_extent > 0.0;
}

LinkExtent link_extent(const CloudSnapshot& cloud, const LinkQueryState& link) {
  const InnerSphereTree& tree = link.context.tree();
  return {cloud.extent, (link.search.X_FL * tree.center() - cloud.extent.p_FS).norm(),
          tree.radius()};
}

// [m] The largest radius of the obstacles whose spheres may be nearer than `limit`. Points that a
// cloud's region of interest has discarded count.
double largest_radius_within(double limit, SnapshotSpan clouds, const LinkQueryState& link) {
  double largest = 0.0;
  for (const CloudSnapshot* cloud : clouds) {
    if (!has_extent(*cloud)) continue;
    largest = std::max(
        {largest, cloud->box_extent, link_extent(*cloud, link).largest_radius_within(limit)});
  }
  return largest;
}

// [m] The largest radius of the points of an index that are within `reach` of the link: depth
// first, without the boxes that hold no larger one than was found.
double largest_radius_near(const PointObstacles& obstacles, const LinkExtent& extent,
                           const InnerSphereTree& tree, double reach) {
  const Eigen::Vector3d p_OS = obstacles.X_FO.inverse() * extent.points.p_FS;
  const Eigen::Vector3d center_O = obstacles.X_OL * tree.center();
  const double within_sq = std::pow(tree.radius() + reach + kDistanceRounding, 2);
  const std::vector<BoxNode>& nodes = obstacles.bvh->nodes();
  TraversalStack<std::int32_t, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack;
  PointTile scratch;
  double largest = 0.0;
  stack.push(obstacles.bvh->root());
  while (!stack.empty()) {
    const std::int32_t at = stack.pop();
    if (at < 0) {
      const PointTile& tile = obstacles.bvh->tile(static_cast<std::size_t>(~at), &scratch);
      for (int k = 0; k < tile.count; ++k) {
        if ((tile.point(k) - center_O).squaredNorm() > within_sq) continue;
        largest = std::max(largest, extent.radius((tile.point(k) - p_OS).norm()));
      }
      continue;
    }
    const BoxNode& node = nodes[static_cast<std::size_t>(at)];
    for (int k = 0; k < node.count; ++k) {
      const Eigen::AlignedBox3d box(Eigen::Vector3d(node.min_x[k], node.min_y[k], node.min_z[k]),
                                    Eigen::Vector3d(node.max_x[k], node.max_y[k], node.max_z[k]));
      const double range =
          (box.min() - p_OS).cwiseAbs().cwiseMax((box.max() - p_OS).cwiseAbs()).norm();
      if (box.squaredExteriorDistance(center_O) <= within_sq && extent.radius(range) > largest) {
        stack.push(node.child[k]);
      }
    }
  }
  return largest;
}

// [m] No sphere of a point outside the regions of interest is nearer: the distance of such points
// grows faster than their radius.
double region_bound(SnapshotSpan clouds, const LinkQueryState& link) {
  const double points = link.search.region_bound;
  double bound = points;
  for (const CloudSnapshot* cloud : clouds) {
    const LinkExtent extent = link_extent(*cloud, link);
    const double radius = extent.largest_radius_beyond(points);
    bound = std::min(bound, points - std::max(radius, cloud->box_extent));
  }
  return bound;
}

}  // namespace

// Links reach farther by the radius of what is at the end of their range.
void LinkQuery::begin_extents(SnapshotSpan clouds, double other_extents) {
  LinkSearch& search = link_.search;
  search.extents = ExtentResult();
  search.other_extents = other_extents;
  search.extent_range = 0.0;
  const auto has = [](const CloudSnapshot* cloud) { return has_extent(*cloud); };
  search.has_extents = std::any_of(clouds.begin(), clouds.end(), has);
  if (!search.has_extents) return;
  search.extent_range = largest_radius_within(own_range(search), clouds, link_);
  if (other_extents == kInfinity) return;
  // A link that is farther than this is farther than the others' spheres with its own.
  search.other_links = std::max(
      search.other_links, other_extents + largest_radius_within(other_extents, clouds, link_));
}

// Finds a lower bound of the spheres. The bound of the points, less the largest radius of those
// that matter, is one; it is good enough where radii vary little. Elsewhere a search of the spheres
// follows.
// @returns false: the deadline passed before the bound was as good as the tolerance asks
bool LinkQuery::bound_extents(SnapshotSpan clouds, Deadline* deadline) {
  LinkSearch& search = link_.search;
  if (!search.has_extents) return true;
  const double points = search.lower_bound();
  ExtentSearch spheres;
  spheres.points_bound = points;
  spheres.range = own_range(search) + search.rounding;
  spheres.other_links = search.other_extents;
  spheres.width = search.width(std::max(search.closest.exact.distance, 0.0));
  if (search.closest.exact.distance < kInfinity) {
    spheres.upper = search.closest.exact.distance - radius_of_closest(clouds);
  }
  search.extents.upper = spheres.upper;
  const auto by_points = [&] {
    return points - largest_radius_within(spheres.limit(), clouds, link_);
  };
  double& bound = search.extents.lower_bound;
  bound = std::max(by_points(), search.first_extent_bound);
  const auto is_enough = [&] { return bound >= spheres.prune_bound() - search.rounding; };
  // Where a point may be inside the link, nothing else is known of the spheres.
  const bool is_decided =
      search.is_complete && search.other_links > 0.0 && search.outside_bound > -kInfinity;
  const bool is_outside = points > 0.0 || (is_decided && search.closest.exact.distance > 0.0);
  if (is_enough()) return true;
  if (!is_outside && deadline->has_passed()) return false;
  if (!is_outside) {
    bound = std::max(bound, contact_bound(clouds, points, spheres.limit()));
    return true;
  }
  bound = std::max(bound, std::min(link_.kept.extents.at(search.scene, search.X_FL),
                                   region_bound(clouds, link_)));
  if (is_enough()) return true;
  if (deadline->passed()) return false;
  measure_extent_again(clouds, &spheres);
  search.extents.upper = spheres.upper;
  bound = std::max(bound, by_points());
  if (is_enough()) return true;
  const bool complete = search_extents(clouds, &spheres);
  bound = std::max(bound, std::min({spheres.refined, spheres.upper, region_bound(clouds, link_)}));
  search.extents.upper = spheres.upper;
  if (complete) link_.kept.extents.prove(search.scene, search.X_FL, bound - search.index_error);
  return complete;
}

// The range is so much larger with extents that a point may be in it whose sphere, and all others,
// are not.
bool LinkQuery::is_clear_of_extents() const {
  const LinkSearch& search = link_.search;
  return search.has_extents && search.is_complete && is_inside_regions() &&
         search.closest.exact.distance > own_range(search) + search.rounding &&
         search.extent_bound() >= own_range(search) + search.rounding;
}

// [m] The radius of the closest obstacle.
double LinkQuery::radius_of_closest(SnapshotSpan clouds) const {
  const ClosestObstacle& closest = link_.search.closest;
  const CloudSnapshot& cloud = *clouds[static_cast<std::size_t>(closest.source)];
  if (closest.is_box) return cloud.box_extent;
  return link_extent(cloud, link_).radius((closest.p_FCo - cloud.extent.p_FS).norm());
}

// Calls visit(obstacles, measure) for every index, until it returns false. The indices that are
// left then, and those whose spheres cannot matter, leave their bound.
// @returns whether it never did
template <class Visit>
bool LinkQuery::for_each_extent(SnapshotSpan clouds, const Visit& visit, ExtentSearch* spheres) {
  bool visited_all = true;
  // Whether an index is searched: its nearest point may be within the limit with its radius. The
  // bound of one that is not is kept for poses with other limits, so that it must hold beyond.
  const auto matters = [&](double radius_within, double radius_beyond) {
    const double points = spheres->points_bound;
    if (points - radius_within < spheres->prune_bound()) return true;
    const double within = std::min(spheres->limit(), points - radius_within);
    spheres->refined = std::min(spheres->refined, std::max(within, points - radius_beyond));
    return false;
  };
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    const CloudSnapshot& cloud = *clouds[i];
    const LinkExtent extent = link_extent(cloud, link_);
    const auto visit_index = [&](const auto& obstacles) {
      using Obstacles = std::decay_t<decltype(obstacles)>;
      constexpr bool kPoints = std::is_same_v<Obstacles, PointObstacles>;
      const double within =
          kPoints ? extent.largest_radius_within(spheres->limit()) : cloud.box_extent;
      const double beyond =
          kPoints ? extent.largest_radius_beyond(spheres->points_bound) : cloud.box_extent;
      if (!visited_all) {
        spheres->refined = std::min(spheres->refined, spheres->points_bound - beyond);
        return;
      }
      if (!matters(within, beyond)) return;
      ExtentMeasure<Obstacles> measure(obstacles, extent, cloud.box_extent, &link_, spheres);
      visited_all = visit(obstacles, &measure);
    };
    for_each_index(clouds, i, visit_index);
  }
  return visited_all;
}

// [m] No sphere is nearer, by the largest radius of what is near the link.
double LinkQuery::contact_bound(SnapshotSpan clouds, double points, double limit) {
  double largest = 0.0;
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    const CloudSnapshot& cloud = *clouds[i];
    if (!has_extent(cloud)) continue;
    const LinkExtent extent = link_extent(cloud, link_);
    const double reach = std::max(limit + extent.largest_radius_within(limit), 0.0);
    for_each_index(clouds, i, [&](const auto& obstacles) {
      if constexpr (is_points<decltype(obstacles)>) {
        largest =
            std::max(largest, largest_radius_near(obstacles, extent, link_.context.tree(), reach));
      } else {
        largest = std::max(largest, cloud.box_extent);
      }
    });
  }
  return std::min(points - largest, region_bound(clouds, link_));
}

// The sphere that was nearest last time is a first upper bound.
void LinkQuery::measure_extent_again(SnapshotSpan clouds, ExtentSearch* spheres) {
  const auto nearest = link_.kept.nearest_extent;
  if (nearest.build_id == 0) return;
  for_each_extent(
      clouds,
      [&](const auto& obstacles, auto* measure) {
        if (obstacles.bvh->build_id() == nearest.build_id) measure->measure(nearest.id);
        return true;
      },
      spheres);
}

bool LinkQuery::search_extents(SnapshotSpan clouds, ExtentSearch* spheres) {
  return for_each_extent(
      clouds,
      [&](const auto& obstacles, auto* measure) {
        enter(obstacles);
        const std::uint64_t id = obstacles.bvh->build_id() | kExtentFront;
        const CloudSnapshot& cloud = *clouds[static_cast<std::size_t>(obstacles.source)];
        const SearchOutcome found =
            search(obstacles, front_of(id, obstacles.X_OL, &cloud), measure);
        spheres->refined = std::min(
            spheres->refined, static_cast<double>(found.pruned_bound) - link_.search.rounding);
        return found.has_time;
      },
      spheres);
}

}  // namespace ist
