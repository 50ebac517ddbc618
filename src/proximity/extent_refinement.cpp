#include "proximity/extent_refinement.h"

namespace ist {
namespace {

// The traversal adds or subtracts a radius once for each bound, in float.
constexpr double kFloatRounding = 2.4e-7;

double radius_rounding(const LinkSearch& search, double largest_radius) {
  return kFloatRounding * (search.range() + 2.0 * largest_radius);
}

}  // namespace

PointExtentRefinement::PointExtentRefinement(const PointObstacles& obstacles,
                                             const LinkExtent& extent, LinkQueryState* link,
                                             ExtentSearch* search)
    : obstacles_(obstacles),
      extent_(extent),
      link_(*link),
      search_(*search),
      points_(obstacles, link),
      p_OS_(obstacles.X_FO.inverse() * extent.points.p_FS),
      rounding_(radius_rounding(link->search, extent.largest_radius())),
      largest_radius_(round_up(extent.largest_radius() + rounding_)) {}

float PointExtentRefinement::bound_box(std::int32_t slot, std::int32_t child, const float* min,
                                       const float* max) {
  const double enough = search_.prune_bound() + static_cast<double>(largest_radius(slot, min, max));
  return points_.bound_box(slot, child, min, max, enough);
}

// Whatever is met is bounded: by the pair's spheres, by what was kept of the point, by the link's
// grid, or by its exact distance. All bounds are of the point; its radius is taken off.
float PointExtentRefinement::refine(std::int32_t tile, int lane, float lower_bound) {
  LinkSearch& search = link_.search;
  const ObstacleId id{tile, lane};
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id);
  const double r = radius(p_OQ);
  const double by_pair = static_cast<double>(lower_bound) - search.rounding - r;
  if (by_pair >= search_.prune_bound() || deadline_passed()) {
    search_.refined = std::min(search_.refined, by_pair);
    return traversal_prune_bound();
  }
  if (!search.visited.insert(id.key())) return traversal_prune_bound();
  const Eigen::Vector3d p_LQ = obstacles_.X_LO * p_OQ;
  const double kept = link_.kept.distances.find(DistanceCache::Quantity::kUnsigned,
                                                coherent_key(obstacles_, id), p_LQ);
  const double enough = search_.prune_bound() + r;
  double bound = std::max(kept, search_.points_bound);
  if (bound < enough) bound = std::max(bound, points_.grid_bound({p_LQ}, enough).surface_distance);
  if (bound >= enough) {
    search_.refined = std::min(search_.refined, bound - r);
  } else {
    measure(id, p_OQ, p_LQ);
  }
  return traversal_prune_bound();
}

void PointExtentRefinement::measure(ObstacleId id) {
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id);
  measure(id, p_OQ, obstacles_.X_LO * p_OQ);
}

void PointExtentRefinement::measure(ObstacleId id, const Eigen::Vector3d& p_OQ,
                                    const Eigen::Vector3d& p_LQ) {
  LinkSearch& search = link_.search;
  search.count_exact();
  const double r = radius(p_OQ);
  const double limit = search_.limit() + r + search.rounding;
  const bool has_closest = search.closest.exact.distance < std::numeric_limits<double>::infinity();
  double lower_bound;
  const SignedDistance exact = distance_outside(
      link_.context.solid(), p_LQ, limit,
      has_closest ? search.closest.exact.normal : link_.kept.plane_normal_L, 0.0, &lower_bound);
  link_.kept.distances.store(DistanceCache::Quantity::kUnsigned, coherent_key(obstacles_, id), p_LQ,
                             lower_bound);
  search_.refined = std::min(search_.refined, std::max(lower_bound, search_.points_bound) - r);
  if (!(exact.distance - r < search_.upper)) return;
  search_.upper = exact.distance - r;
  link_.kept.nearest_extent = {obstacles_.bvh->build_id(), id};
}

BoxExtentRefinement::BoxExtentRefinement(const BoxObstacles& obstacles, double extent,
                                         LinkQueryState* link, ExtentSearch* search)
    : obstacles_(obstacles),
      extent_(extent),
      link_(*link),
      search_(*search),
      largest_radius_(round_up(extent + radius_rounding(link->search, extent))) {}

float BoxExtentRefinement::refine(std::int32_t tile, int lane, float lower_bound) {
  const double by_pair = static_cast<double>(lower_bound) - link_.search.rounding - extent_;
  const ObstacleId id{tile, lane};
  if (by_pair >= search_.prune_bound() || deadline_passed()) {
    search_.refined = std::min(search_.refined, by_pair);
  } else if (link_.search.visited.insert(id.key())) {
    measure(id);
  }
  return traversal_prune_bound();
}

void BoxExtentRefinement::measure(ObstacleId id) {
  LinkSearch& search = link_.search;
  ++search.statistics->exact_evaluations;
  const double limit = search_.limit() + extent_ + search.rounding;
  const BoxDistance found = distance_to_box(link_.context.solid(), box_O(*obstacles_.bvh, id),
                                            obstacles_.X_OL, std::max(limit, 0.0));
  search_.refined =
      std::min(search_.refined, std::max(found.lower_bound, search_.points_bound) - extent_);
  if (!(found.distance - extent_ < search_.upper)) return;
  search_.upper = found.distance - extent_;
  link_.kept.nearest_extent = {obstacles_.bvh->build_id(), id};
}

}  // namespace ist
