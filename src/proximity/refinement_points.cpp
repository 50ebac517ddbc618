// The exact distances of points.

#include <algorithm>

#include "proximity/refinement.h"

namespace ist {
namespace {

// The share of the tolerance that the distance of one point may take.
constexpr double kPointShare = 0.25;

}  // namespace

float PointRefinement::refine(std::int32_t tile, int lane, float lower_bound) {
  LinkSearch& search = link_.search;
  search.cover_bound =
      std::min(search.cover_bound, static_cast<double>(lower_bound) - search.rounding);
  const ObstacleId id{tile, lane};
  if (!search.visited.insert(id.key())) return search.traversal_prune_bound();
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id), p_LQ = obstacles_.X_LO * p_OQ;
  const double kept = link_.kept.distances.find(obstacles_.bvh->build_id(),
                                                DistanceCache::Quantity::kUnsigned, id.key(), p_LQ);
  if (kept >= search.prune_bound()) {
    search.prune(kept);
  } else {
    const bool has_closest =
        search.closest.exact.distance < std::numeric_limits<double>::infinity();
    measure_outside(id, p_OQ, p_LQ, std::numeric_limits<double>::infinity(),
                    has_closest ? search.closest.exact.normal : link_.kept.plane_normal_L);
  }
  return search.traversal_prune_bound();
}

bool PointRefinement::update_planes(SupportingPlanes* planes) {
  return update_supporting_planes(obstacles_.X_OL, &link_, planes);
}

void PointRefinement::measure(ObstacleId id, double max_distance) {
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id), p_LQ = obstacles_.X_LO * p_OQ;
  const InnerSphereTree& tree = link_.context.tree();
  if (tree.cover_distance_exceeds(p_LQ, tree.interior_gap())) {
    return measure_outside(id, p_OQ, p_LQ, max_distance, link_.kept.plane_normal_L);
  }
  ++link_.search.statistics->exact_evaluations;
  link_.search.offer(link_.context.solid().signed_distance(p_LQ), p_OQ, obstacles_, id);
}

void PointRefinement::measure_outside(ObstacleId id, const Eigen::Vector3d& p_OQ,
                                      const Eigen::Vector3d& p_LQ, double max_distance,
                                      const Eigen::Vector3d& direction_L) {
  LinkSearch& search = link_.search;
  ++search.statistics->exact_evaluations;
  const double limit = std::min({search.closest.exact.distance, search.other_links,
                                 search.range() + search.rounding, max_distance});
  double lower_bound;
  const SignedDistance exact =
      distance_outside(link_.context.solid(), p_LQ, limit, direction_L,
                       kPointShare * search.config.tolerance, &lower_bound);
  link_.kept.distances.store(obstacles_.bvh->build_id(), DistanceCache::Quantity::kUnsigned,
                             id.key(), p_LQ, lower_bound);
  if (lower_bound < exact.distance) {
    search.refined_bound = std::min(search.refined_bound, lower_bound);
  }
  search.offer(exact, p_OQ, obstacles_, id);
}

}  // namespace ist
