#include "proximity/link_query.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "proximity/depth_search.h"
#include "proximity/dual_tree.h"
#include "proximity/first_bound.h"
#include "proximity/refinement.h"
#include "proximity/separating_planes.h"
#include "proximity/single_tree_search.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Error of a lower bound in float, relative to the numbers involved: posing a centre takes seven
// roundings of 2^-24, a distance five more; this is above their sum.
constexpr double kFloatError = 1e-6;
// Error of a stored point: half a unit in the last place in each coordinate.
constexpr double kPointError = 1.1e-7;
// [m] More than double loses where distances are compared.
constexpr double kRounding = 1e-12;
// A link that is nearer than so many interior gaps is searched with signed distances.
constexpr double kNearInGaps = 2.0;
// So does one at a distance that is about that of the last crowded search, by this factor.
constexpr double kSameCrowd = 1.5;
// A link that is nearer than so many radii of its bounding sphere gets its first bound by more and
// smaller spheres.
constexpr double kFineSpheresWithin = 0.5;
// Nodes that are divided for a first bound by a supporting plane.
constexpr int kQuickSteps = 16;
// [m] A link that no first bound was found for is tried again when it has moved so far.
constexpr double kFirstBoundAgain = 0.02;
// How many steps ahead are proven, of a link that need only be known to be farther than another.
constexpr double kStepsAhead = 8.0;

// Whether what was answered for one question is an answer to another: it has to be as exact.
bool answers(const QueryConfig& answered, const QueryConfig& asked) {
  return answered.max_distance == asked.max_distance && answered.margin == asked.margin &&
         answered.tolerance <= asked.tolerance &&
         answered.relative_tolerance <= asked.relative_tolerance;
}

// The child whose box is nearest to a place.
int nearest_child(const BoxNode& node, const Eigen::Vector3d& p_O) {
  int nearest = 0;
  double least_sq = kInfinity;
  for (int k = 0; k < node.count; ++k) {
    const Eigen::AlignedBox3d box(Eigen::Vector3d(node.min_x[k], node.min_y[k], node.min_z[k]),
                                  Eigen::Vector3d(node.max_x[k], node.max_y[k], node.max_z[k]));
    const double distance_sq = box.squaredExteriorDistance(p_O);
    if (!(distance_sq < least_sq)) continue;
    least_sq = distance_sq;
    nearest = k;
  }
  return nearest;
}

}  // namespace

void LinkQuery::begin(const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, SceneId scene,
                      const QueryConfig& config, const OtherLinks& other_links,
                      QueryStatistics* statistics, Deadline* deadline) {
  LinkSearch& search = link_.search;
  const auto& answered = link_.kept.answered;
  const RigidPose rigid = nearest_rigid(X_FL);
  search.X_FL_given = X_FL;
  search.X_FL = rigid.X;
  search.drift = rigid.drift;
  search.scene = scene;
  search.config = config;
  search.other_links = other_links.distance;
  search.statistics = statistics;
  search.deadline = deadline;
  search.closest = ClosestObstacle();
  search.refined_bound = kInfinity;
  search.region_bound = kInfinity;
  // Before anything is proven: no point is deeper than the radius of the bounding sphere.
  search.pruned_bound = -link_.context.tree().radius();
  search.rounding = search.max_coordinate = search.index_error = 0.0;
  search.is_complete = false;
  search.measured = 0;
  search.is_counted = false;
  search.first_bound = -kInfinity;
  search.is_answered = scene != kUnknownScene && answered.scene == scene &&
                       other_links.distance == kInfinity && answers(answered.config, config) &&
                       answered.X_FL.matrix() == X_FL.matrix();
  begin_extents(clouds, other_links.extents);
  if (search.is_answered) static_cast<SearchResult&>(search) = answered.result;
}

void LinkQuery::tighten(const QueryConfig& config) {
  LinkSearch& search = link_.search;
  if (search.is_answered && answers(link_.kept.answered.config, config)) return;
  search.is_answered = false;
  search.config = config;
  search.first_bound = search.lower_bound();
  search.first_extent_bound = search.extents.lower_bound;
  search.refined_bound = kInfinity;
  search.pruned_bound = -link_.context.tree().radius();
  search.is_complete = false;
}

bool LinkQuery::run(SnapshotSpan clouds, Deadline* deadline) {
  LinkSearch& search = link_.search;
  if (search.is_answered) {
    count_outside_region();
    return true;
  }
  Deadline* const of_question = std::exchange(search.deadline, deadline);
  const bool has_points = search_points(clouds, deadline);
  const bool has_extents = bound_extents(clouds, deadline);
  search.deadline = of_question;  // the caller's own may not outlive this call
  if (has_points && has_extents) keep_answer();
  return has_points && has_extents;
}

// @returns false: the deadline passed before the points were known to the tolerance
bool LinkQuery::search_points(SnapshotSpan clouds, Deadline* deadline) {
  LinkSearch& search = link_.search;
  if (is_settled(clouds)) return true;
  if (deadline->passed()) {
    take_kept_bound();
    return false;
  }
  const double distance = search.closest.exact.distance;
  link_.context.grid.set_distance(distance < kInfinity ? distance : 0.0);
  search.pruned_bound = search.cover_bound = kInfinity;
  look_ahead();
  search.box_cells_left = link_.context.solid().is_closed() ? kMaxBoxCells : kMaxBoxCellsWithHoles;
  search.descent_steps_left = kMaxDescentSteps;
  count_outside_region();
  if (!is_inside_regions()) search.prune(search.region_bound);
  bool stopped = false;
  for (std::size_t i = 0; i < clouds.size() && !stopped; ++i) {
    for_each_index(*clouds[i], static_cast<std::int32_t>(i), search.X_FL,
                   [&](const auto& obstacles) { stopped = stopped || !run(obstacles); });
  }
  if (stopped) search.prune(-link_.context.tree().radius());  // indices that were not reached
  search.is_complete = !stopped;
  if (search.is_complete) {
    keep_bound();
  } else {
    take_kept_bound();
  }
  return search.is_complete;
}

// A link counts once in a query, however often it is run.
void LinkQuery::count_outside_region() {
  LinkSearch& search = link_.search;
  if (search.is_counted || is_inside_regions()) return;
  search.is_counted = true;
  ++search.statistics->outside_region;
}

// A search that the deadline stopped proves no less than what was proven before.
void LinkQuery::take_kept_bound() {
  LinkSearch& search = link_.search;
  const LinkBound& kept = link_.kept.bound;
  const double coherent = search.closest.exact.distance > 0.0
                              ? std::min(kept.at(search.scene, search.X_FL), search.region_bound)
                              : -kInfinity;
  const double bound = std::max(coherent, search.first_bound);
  if (!(bound > search.lower_bound())) return;
  search.pruned_bound = std::max(search.pruned_bound, bound);
  search.refined_bound = std::max(search.refined_bound, bound);
  search.max_coordinate =
      std::max(search.max_coordinate,
               kept.max_coordinate() + kept.displacement_to(search.scene, search.X_FL));
}

void LinkQuery::keep_answer() {
  const LinkSearch& search = link_.search;
  auto& answered = link_.kept.answered;
  const bool is_whole = search.other_links == kInfinity;
  answered.scene = is_whole ? search.scene : kUnknownScene;
  answered.X_FL = search.X_FL_given;
  answered.config = search.config;
  answered.result = search;
}

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
    search.prune(-link_.context.tree().radius());
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

// Step 1: any obstacle, measured exactly, bounds the distance from above. What was the closest
// point of the link to the last answer's obstacle is still a point of the link.
void LinkQuery::warm_start(SnapshotSpan clouds, bool has_time) {
  if (link_.search.is_answered) return;
  const auto& last = link_.kept.last;
  const auto measure_last = [&](const auto& obstacles) {
    if (last.build_id == 0 || obstacles.bvh->build_id() != last.build_id) return;
    enter(obstacles);
    measure_again(obstacles);
  };
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    for_each_index(*clouds[i], static_cast<std::int32_t>(i), link_.search.X_FL, measure_last);
  }
  if (distance() < kInfinity || !has_time) return;
  // A new cloud has about the same obstacle about the same place, unless the link has left it.
  const auto measure_near = [&](const Eigen::Vector3d& p_FQ) {
    for (std::size_t i = 0; i < clouds.size(); ++i) {
      for_each_index(*clouds[i], static_cast<std::int32_t>(i), link_.search.X_FL,
                     [&](const auto& obstacles) { measure_near_place(obstacles, p_FQ); });
    }
  };
  if (last.has_place) measure_near(last.p_FCo);
  if (distance() == kInfinity) measure_near(link_.search.X_FL * link_.context.tree().center());
}

// Measures an obstacle that is near a place, though perhaps not the nearest: of the points of one
// tile, the one nearest to the last closest point of the link. Noise has moved all of them.
void LinkQuery::measure_near_place(const PointObstacles& obstacles, const Eigen::Vector3d& p_FQ) {
  const Eigen::Vector3d p_OQ = obstacles.X_FO.inverse() * p_FQ;
  std::int32_t child = obstacles.bvh->root();
  while (child >= 0) {
    const BoxNode& node = obstacles.bvh->nodes()[static_cast<std::size_t>(child)];
    child = node.child[nearest_child(node, p_OQ)];
  }
  enter(obstacles);
  PointTile scratch;
  const PointTile& tile = obstacles.bvh->tile(static_cast<std::size_t>(~child), &scratch);
  const auto& last = link_.kept.last;
  const Eigen::Vector3d p_OC = last.has_place ? obstacles.X_OL * last.p_LCl : p_OQ;
  int nearest = 0;
  for (int k = 1; k < tile.count; ++k) {
    if ((tile.point(k) - p_OC).squaredNorm() < (tile.point(nearest) - p_OC).squaredNorm()) {
      nearest = k;
    }
  }
  // A point of the link's surface is no nearer than the surface.
  const double distance = last.has_place ? (tile.point(nearest) - p_OC).norm() : kInfinity;
  PointRefinement(obstacles, &link_)
      .measure({~child, nearest}, (1.0 + 1e-9) * distance + kRounding);
}

// Boxes have an upper bound of their own.
void LinkQuery::measure_near_place(const BoxObstacles& /*obstacles*/,
                                   const Eigen::Vector3d& /*p_FQ*/) {}

void LinkQuery::measure_again(const PointObstacles& obstacles) {
  const auto& last = link_.kept.last;
  const double distance = (obstacles.X_LO * point_O(*obstacles.bvh, last.id) - last.p_LCl).norm();
  PointRefinement(obstacles, &link_).measure(last.id, (1.0 + 1e-9) * distance + kRounding);
}

void LinkQuery::measure_again(const BoxObstacles& obstacles) {
  const auto& last = link_.kept.last;
  const Eigen::AlignedBox3d box = box_O(*obstacles.bvh, last.id);
  BoxRefinement refinement(obstacles, &link_);
  if (last.was_inside && link_.context.solid().is_closed()) {
    // The deepest point of a box hardly changes. With holes, the centre of a box may decide.
    refinement.take_point(clamp_to(box, obstacles.X_FO.inverse() * last.p_FCo), last.id);
    if (distance() < 0.0) return;
  }
  const Eigen::Vector3d p_OCl = obstacles.X_OL * last.p_LCl;
  const double distance = (p_OCl - clamp_to(box, p_OCl)).norm();
  refinement.measure(last.id, (1.0 + 1e-9) * distance + kRounding, p_OCl);
}

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
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      input.R_OL[3 * row + column] = static_cast<float>(obstacles.X_OL.linear()(row, column));
    }
    input.p_OL[row] = static_cast<float>(obstacles.X_OL.translation()[row]);
  }
  input.rounding = round_up(search.rounding);
  input.prune_bound = search.traversal_prune_bound();
  input.inside_bound = round_up(link_.context.tree().interior_gap() + search.rounding);
  input.supports = &link_.kept.supports;
  input.planes = supporting_planes(obstacles.X_OL, link_);
  return input;
}
template DualTreeInput<PointBvh> LinkQuery::dual_tree_input(const PointObstacles& obstacles);
template DualTreeInput<BoxBvh> LinkQuery::dual_tree_input(const BoxObstacles& obstacles);

// Accounts for the rounding in the frame of an index.
template <class Obstacles>
void LinkQuery::enter(const Obstacles& obstacles) {
  LinkSearch& search = link_.search;
  const double range = search.config.max_distance + search.config.margin + search.extent_range;
  const double extent = this->extent();
  const double coordinate = obstacles.X_OL.translation().cwiseAbs().maxCoeff() + extent;
  search.max_coordinate = std::max(search.max_coordinate, coordinate);
  const double lever = obstacles.X_OL.translation().norm() + extent + obstacles.drift_lever;
  search.index_error = std::max(search.index_error, pose_error(obstacles.drift, lever, range));
  search.rounding =
      std::max(search.rounding, kFloatError * (coordinate + range) +
                                    pose_error(search.drift, extent, range) + search.index_error);
}
template void LinkQuery::enter(const PointObstacles& obstacles);
template void LinkQuery::enter(const BoxObstacles& obstacles);

double LinkQuery::extent() const {
  const InnerSphereTree& tree = link_.context.tree();
  return tree.center().norm() + tree.radius();
}

// Whether the bound that was proven at another pose is enough at this one.
bool LinkQuery::is_settled(SnapshotSpan clouds) {
  LinkSearch& search = link_.search;
  const InnerSphereTree& tree = link_.context.tree();
  search.region_bound = kInfinity;
  for (const CloudSnapshot* cloud : clouds) {
    const RegionOfInterest& region = cloud->region;
    const double from_center = (search.X_FL * tree.center() - region.center_F).norm();
    search.region_bound =
        std::min(search.region_bound, std::max(region.radius - from_center, 0.0) - tree.radius());
  }
  search.region_bound -= pose_error(search.drift, extent(), 0.0);
  const LinkBound& kept = link_.kept.bound;
  const double bound = kept.at(search.scene, search.X_FL);
  if (!is_inside_regions() || !(bound >= search.prune_bound() - kRounding) ||
      !(search.closest.exact.distance > 0.0)) {
    return false;
  }
  search.pruned_bound = bound;
  search.max_coordinate =
      std::max(search.max_coordinate,
               kept.max_coordinate() + kept.displacement_to(search.scene, search.X_FL));
  search.is_complete = true;
  return true;
}

// A link that need only be known to be farther than another is proven to be a little farther still:
// that spares the queries to come, as many steps as long as the last ones.
void LinkQuery::look_ahead() {
  LinkSearch& search = link_.search;
  if (search.other_links == kInfinity) return;
  const double ahead = kStepsAhead * link_.kept.bound.displacement_to(search.scene, search.X_FL);
  if (ahead < search.other_links) search.other_links += ahead;
}

// The grid, the distances and the link's bound are about the geometry. Fronts, bounds by node,
// supports and the terms of the last answer are about the tree.
void LinkQuery::set_link(const LinkModel& link) {
  LinkContext& context = link_.context;
  const bool is_same = link.packing_id != 0 && link.packing_id == context.model->packing_id;
  context.model = &link;
  context.grid.set_solid(link.solid);
  if (is_same) return;
  context.displacement = DisplacementBound(link);
  LinkCoherence& kept = link_.kept;
  kept.bound.set_link(link);
  kept.extents.set_link(link);
  kept.nodes.forget();
  kept.fronts.forget();
  kept.answered.scene = kUnknownScene;
  kept.supports = SupportCache(link.tree);
  kept.plane_normal_L.setZero();
}

void LinkQuery::keep_bound() {
  const LinkSearch& search = link_.search;
  keep_bound(search.lower_bound(), std::min(search.cover_bound, search.pruned_bound));
}

// @param bound           [m] of the stored obstacles' signed distances
// @param cover_distance  [m] of the stored obstacles
void LinkQuery::keep_bound(double bound, double cover_distance) {
  const LinkSearch& search = link_.search;
  bound -= search.index_error;
  // Float loses more, the farther.
  if (bound > search.range()) bound -= kFloatError * (bound - search.range());
  link_.kept.bound.prove(search.scene, search.X_FL, bound, cover_distance, search.max_coordinate);
}

// Keeps the least of the bounds of all indices, if it is positive.
// @param bound_of_index  (obstacles) -> [m] no obstacle has a smaller signed distance, but for the
//                        rounding; not positive where one may be inside
template <class BoundOfIndex>
void LinkQuery::prove_bound(SnapshotSpan clouds, const BoundOfIndex& bound_of_index) {
  double bound = kInfinity;
  const auto take = [&](const auto& obstacles) {
    enter(obstacles);
    bound = std::min(bound, bound_of_index(obstacles));
  };
  for (std::size_t i = 0; i < clouds.size() && bound > 0.0; ++i) {
    for_each_index(*clouds[i], static_cast<std::int32_t>(i), link_.search.X_FL, take);
  }
  bound -= link_.search.rounding;
  // A mesh with holes is bounded by its cover spheres alone: the bound is a cover distance, too.
  if (bound > 0.0) keep_bound(bound, bound);
}

// Obstacles that are farther from the cover spheres than the interior gap are outside the link, and
// so is what is above a supporting plane.
void LinkQuery::prove_first_bound(SnapshotSpan clouds, Deadline* deadline, double late) {
  LinkSearch& search = link_.search;
  if (search.is_answered || link_.kept.bound.at(search.scene, search.X_FL) > 0.0) return;
  auto& last = link_.kept.first_bound;
  const bool is_late = deadline->has_passed();
  if (last.scene == search.scene && search.scene != kUnknownScene &&
      !(is_late && last.was_proven) &&
      link_.context.displacement.between(last.X_FL, search.X_FL) < kFirstBoundAgain) {
    return;
  }
  last.scene = search.scene;
  last.X_FL = search.X_FL;
  last.by_planes = false;
  const InnerSphereTree& tree = link_.context.tree();
  prove_bound(clouds, [&](const auto& obstacles) {
    const auto by_spheres = [&](bool is_fine) {
      const auto bound = static_cast<double>(
          first_bound(PosedSpheres(tree, obstacles.X_OL, is_fine), obstacles.bvh->nodes().data(),
                      obstacles.bvh->root(), deadline, late));
      const bool is_outside = bound - search.rounding > tree.interior_gap();  // false for NaN
      return is_outside ? bound : -kInfinity;
    };
    const double bound = by_spheres(false);
    if (bound >= kFineSpheresWithin * tree.radius() || deadline->passed_by(late)) return bound;
    if (!link_.context.solid().is_closed()) return by_spheres(true);
    return bound_by_planes(obstacles, deadline, late);
  });
  last.was_proven = link_.kept.bound.at(search.scene, search.X_FL) > 0.0;
  // The next query tries again a bound that was cut short.
  if (!last.was_proven && deadline->passed_by(late)) last.scene = kUnknownScene;
}

void LinkQuery::prove_bound_by_planes(SnapshotSpan clouds, Deadline* deadline) {
  LinkSearch& search = link_.search;
  auto& last = link_.kept.first_bound;
  if (search.is_answered || last.scene != search.scene || last.by_planes ||
      !link_.context.solid().is_closed() || !(search.closest.exact.distance > 0.0) ||
      link_.kept.bound.at(search.scene, search.X_FL) > 0.0) {
    return;
  }
  last.by_planes = true;
  prove_bound(clouds,
              [&](const auto& obstacles) { return bound_by_planes(obstacles, deadline, {}); });
}

// @param late  [s] the search may exceed the deadline by so much, and it is quick: by the plane
// across
//              the closest obstacle alone, in a few steps
template <class Obstacles>
double LinkQuery::bound_by_planes(const Obstacles& obstacles, Deadline* deadline,
                                  std::optional<double> late) {
  const LinkSearch& search = link_.search;
  const InnerSphereTree& tree = link_.context.tree();
  const PosedSpheres spheres(tree, obstacles.X_OL, true);
  SeparatingPlanes planes(*link_.context.model, obstacles.X_OL);
  const SignedDistance& closest = search.closest.exact;
  if (closest.distance > 0.0 && closest.distance < kInfinity) {
    planes.add(obstacles.X_OL.linear() * closest.normal);
  }
  SeparationInput<std::decay_t<decltype(*obstacles.bvh)>> input;
  input.spheres = &spheres;
  input.gap = round_up(tree.interior_gap() + search.rounding);
  input.radius = static_cast<float>(tree.radius());
  input.bvh = obstacles.bvh;
  if (late) {
    input.late = *late;
    input.max_steps = kQuickSteps;
    input.max_planes = planes.count();
  }
  return static_cast<double>(ist::bound_by_planes(input, &planes, deadline));
}

// The error of a distance by the coordinates of stored points and by poses that are not quite
// rigid.
double LinkQuery::answer_error(double distance) const {
  const LinkSearch& search = link_.search;
  return kPointError * (search.max_coordinate + std::abs(distance)) +
         pose_error(search.drift, extent(), distance) + search.index_error;
}

double LinkQuery::proven(double bound) const {
  const LinkSearch& search = link_.search;
  if (bound == kInfinity) return bound;
  return bound - answer_error(bound) - search.config.margin;
}

void LinkQuery::answer(SnapshotSpan clouds, LinkProximity* result) {
  result->reset();
  LinkSearch& search = link_.search;
  auto& last = link_.kept.last;
  last.build_id = 0;
  const ClosestObstacle& closest = search.closest;
  const double distance = closest.exact.distance;
  if (distance > search.range() || is_clear_of_extents()) {
    // UNKNOWN where nothing was measured and not all is known.
    if (!search.is_complete || !is_inside_regions()) return;
    result->state = LinkState::kClear;
    result->distance = kInfinity;
    result->lower_bound = search.config.max_distance;
    return;
  }
  const CloudSnapshot& cloud = *clouds[static_cast<std::size_t>(closest.source)];
  last.build_id = closest.is_box ? cloud.boxes->build_id() : cloud.index.build_id();
  last.id = closest.id;
  last.p_LCl = closest.exact.witness;
  last.p_FCo = closest.p_FCo;
  last.was_inside = distance < 0.0;
  last.has_place = true;
  result->state = distance < 0.0 ? LinkState::kContact : LinkState::kNear;
  result->distance = distance;
  // Points that could be nearer have coordinates no larger than this one's bound.
  result->lower_bound = search.lower_bound() - answer_error(distance) - search.config.margin;
  result->margin = search.config.margin;
  if (search.has_extents) {
    // Spheres that could be nearer have centres farther than that by their radius.
    const double points_bound = result->lower_bound;
    result->lower_bound = points_bound - (search.lower_bound() - search.extent_bound()) -
                          answer_error(search.extent_range);
    result->sensor_width = points_bound - result->lower_bound;
  }
  result->p_LCl = closest.exact.witness;
  result->p_FCl = search.X_FL * closest.exact.witness;
  result->p_FCo = closest.p_FCo;
  result->direction = -(search.X_FL.linear() * closest.exact.normal);
  result->source = closest.source;
  result->point = closest.is_box ? message_id(cloud.boxes->bvh(), closest.id)
                                 : message_id(cloud.index.bvh(), closest.id);
}

}  // namespace ist
