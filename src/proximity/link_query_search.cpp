// The search of one index: the steps of LinkQuery::run().

#include "proximity/link_query.h"

#include <algorithm>
#include <limits>
#include <type_traits>

#include "proximity/depth_search.h"
#include "proximity/dual_tree.h"
#include "proximity/refinement.h"
#include "proximity/single_tree_search.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A link that is nearer than so many interior gaps is searched with signed distances.
constexpr double kNearInGaps = 2.0;
// So is one at about the distance of the last crowded search, within this factor.
constexpr double kSameCrowd = 1.5;

}  // namespace

// Whether the dual-tree traversal gave up, though there is time.
bool LinkQuery::is_crowded(const DualTreeResult& found) const {
  return found.stopped && !link_.search.deadline->has_passed();
}

// The four steps for one index: upper bound, search (which refines what survives its bounds),
// depth.
// @returns false: the deadline passed
template <class Obstacles>
bool LinkQuery::run(const Obstacles& obstacles) {
  enter(obstacles);
  bool is_complete;
  if (search_by_field(obstacles, &is_complete)) return is_complete;
  if (is_near(obstacles)) return search_near(obstacles);
  upper_bound(obstacles);
  const DualTreeResult found = search(obstacles);
  if (is_crowded(found)) {
    link_.kept.crowded_at = link_.search.closest.exact.distance;
    return search_near(obstacles);
  }
  if (found.may_be_inside && !found.stopped) search_inside(obstacles);
  const bool stopped = found.stopped || link_.search.deadline->passed();
  if (stopped) measure_closest(obstacles);
  // A pair that was left may hold a point inside.
  LinkSearch& search = link_.search;
  if (stopped && search.pruned_bound <= link_.context.tree().interior_gap() + search.rounding) {
    search.prune(-link_.context.deepest());
  }
  return !stopped;
}

// Whether the dual-tree traversal would have to measure many points: the link is so near to an
// obstacle that cover spheres bound little, or there were many at about this distance.
bool LinkQuery::is_near(const PointObstacles& /*obstacles*/) const {
  const double distance = link_.search.closest.exact.distance;
  if (!link_.context.solid().is_closed()) return distance < 0.0;
  const double crowded_at = link_.kept.crowded_at;
  return distance < kNearInGaps * link_.context.tree().interior_gap() ||
         (distance > crowded_at / kSameCrowd && distance < kSameCrowd * crowded_at);
}
bool LinkQuery::is_near(const BoxObstacles& /*obstacles*/) { return false; }

// All steps in one, near the link.
bool LinkQuery::search_near(const PointObstacles& obstacles) {
  link_.search.cover_bound = link_.context.solid().is_closed() ? kInfinity : -kInfinity;
  return search_single_tree(obstacles, &link_);
}
bool LinkQuery::search_near(const BoxObstacles& /*obstacles*/) { return true; }

void LinkQuery::search_inside(const PointObstacles& obstacles) {
  search_single_tree(obstacles, &link_);
}
void LinkQuery::search_inside(const BoxObstacles& obstacles) { search_depth(obstacles, &link_); }

// A point that the stopped search has measured as outside may be inside: it had yet to meet the
// spheres that hold it.
template <class Obstacles>
void LinkQuery::measure_closest(const Obstacles& obstacles) {
  const ClosestObstacle& closest = link_.search.closest;
  if (closest.source != obstacles.source ||
      closest.is_box != std::is_same_v<Obstacles, BoxObstacles>) {
    return;
  }
  Refinement<Obstacles>(obstacles, &link_).measure(closest.id);
}

// Among points the search finds a first upper bound as soon as another traversal would.
void LinkQuery::upper_bound(const PointObstacles& /*obstacles*/) {}

// Among boxes, a first upper bound spares exact distances, which are slow; and a box that overlaps
// inner spheres is measured at its deepest points.
void LinkQuery::upper_bound(const BoxObstacles& obstacles) {
  LinkSearch& search = link_.search;
  if (std::min(search.closest.exact.distance, search.other_links) < kInfinity) return;
  const NearestToInnerSpheres nearest = find_nearest_to_inner_spheres(dual_tree_input(obstacles));
  search.statistics->node_pairs += nearest.node_pairs;
  search.statistics->leaf_pairs += nearest.leaf_pairs;
  if (nearest.tile < 0) return;
  BoxRefinement refinement(obstacles, &link_);
  const ObstacleId id{nearest.tile, nearest.lane};
  refinement.measure(id);
  if (nearest.distance < 0.0F) refinement.take_deepest_in_spheres(nearest.leaf, id);
}

// Steps 2 and 3: the dual-tree traversal hands what may be nearer than the upper bound to the
// refinement, which measures it exactly and lowers the upper bound.
template <class Obstacles>
DualTreeResult LinkQuery::search(const Obstacles& obstacles) {
  LinkSearch& search = link_.search;
  search.visited.clear();
  search.outside.clear();
  search.boxes_inside.clear();
  search.refined = 0;
  search.box_bounds.clear();
  auto input = dual_tree_input(obstacles);
  input.front = link_.kept.fronts.find(obstacles.bvh->build_id());
  if (input.front != nullptr) {
    input.front->begin(obstacles.bvh->build_id(), obstacles.X_OL, link_.context.displacement,
                       input.rounding);
  }
  Refinement<Obstacles> refinement(obstacles, &link_);
  const DualTreeResult found = search_dual_tree(input, &refinement);
  search.statistics->node_pairs += found.node_pairs;
  search.statistics->leaf_pairs += found.leaf_pairs;
  if (is_crowded(found)) return found;  // another search follows
  search.prune(static_cast<double>(found.pruned_bound) - search.rounding);
  search.cover_bound =
      std::min(search.cover_bound, static_cast<double>(found.cover_bound) - search.rounding);
  if (found.may_be_inside) search.cover_bound = -kInfinity;
  return found;
}

template <class Bvh>
DualTreeInput<Bvh> LinkQuery::dual_tree_input(const PosedIndex<Bvh>& obstacles) {
  const LinkSearch& search = link_.search;
  DualTreeInput<Bvh> input;
  input.tree = &link_.context.tree();
  input.bvh = obstacles.bvh;
  to_row_major(obstacles.X_OL, input.R_OL, input.p_OL);
  input.rounding = round_up(search.rounding);
  input.prune_bound = search.traversal_prune_bound();
  input.inside_bound = round_up(link_.context.tree().interior_gap() + search.rounding);
  input.supports = &link_.kept.supports;
  input.planes = supporting_planes(obstacles.X_OL, link_);
  return input;
}
template DualTreeInput<PointBvh> LinkQuery::dual_tree_input(const PointObstacles& obstacles);
template DualTreeInput<BoxBvh> LinkQuery::dual_tree_input(const BoxObstacles& obstacles);

template bool LinkQuery::run(const PointObstacles& obstacles);
template bool LinkQuery::run(const BoxObstacles& obstacles);

}  // namespace ist
