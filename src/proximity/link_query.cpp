// What is asked, what is known without a search, and the answer with its rounding.

#include "proximity/link_query.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// Error of a lower bound in float, relative to the numbers involved: posing a centre takes seven
// roundings of 2^-24, a distance five more; this is above their sum.
constexpr double kFloatError = 1e-6;
// Error of a stored point: half a unit in the last place in each coordinate.
constexpr double kPointError = 1.1e-7;
// How many steps ahead are proven, of a link that need only be known to be farther than another.
constexpr double kStepsAhead = 8.0;
// So many parts of boxes a link's query may measure, in contact: with every part the bounds of the
// depth get narrower, but less and less. Fewer of links with holes, where parts bound little
// (Solid::distance_floor).
constexpr int kMaxBoxCells = 256, kMaxBoxCellsWithHoles = kMaxBoxCells / 8;
// So many points a link's query may measure to find one inside where boxes seem only to touch it.
constexpr int kMaxDescentSteps = 128;

// Whether what was answered for one question is an answer to another: it has to be as exact.
bool answers(const QueryConfig& answered, const QueryConfig& asked) {
  return answered.max_distance == asked.max_distance && answered.margin == asked.margin &&
         answered.tolerance <= asked.tolerance &&
         answered.relative_tolerance <= asked.relative_tolerance;
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
  search.pruned_bound = -link_.context.deepest();  // before anything is proven
  search.rounding = search.max_coordinate = search.index_error = 0.0;
  search.is_complete = false;
  search.is_counted = false;
  search.is_answered = scene != kUnknownScene && answered.scene == scene &&
                       other_links.distance == kInfinity && answers(answered.config, config) &&
                       answered.X_FL.matrix() == X_FL.matrix();
  begin_extents(clouds, other_links.extents);
  if (search.is_answered) static_cast<SearchResult&>(search) = answered.result;
}

bool LinkQuery::run(SnapshotSpan clouds, Goal goal, Deadline* deadline) {
  LinkSearch& search = link_.search;
  if (search.is_answered) {
    count_outside_region();
    return true;
  }
  search.goal = goal;
  search.first_bound = search.lower_bound();
  search.first_extent_bound = search.extents.lower_bound;
  search.refined_bound = kInfinity;
  search.pruned_bound = -link_.context.deepest();
  search.is_complete = false;
  Deadline* const of_question = std::exchange(search.deadline, deadline);
  const bool has_points = search_points(clouds, deadline);
  const bool has_extents = goal == Goal::kFree || bound_extents(clouds, deadline);
  search.deadline = of_question;  // the caller's own may not outlive this call
  if (has_points && has_extents && goal == Goal::kTolerance) keep_answer();
  return has_points && has_extents;
}

// @returns false: the deadline passed before the points were known to the tolerance
bool LinkQuery::search_points(SnapshotSpan clouds, Deadline* deadline) {
  LinkSearch& search = link_.search;
  if (is_settled(clouds)) return true;
  if (deadline->passed()) {
    take_kept_bound();
    if (!search.has_time(search.lower_bound())) return false;
  }
  search.pruned_bound = search.outside_bound = kInfinity;
  look_ahead();
  search.box_cells_left = link_.context.solid().is_closed() ? kMaxBoxCells : kMaxBoxCellsWithHoles;
  search.descent_steps_left = kMaxDescentSteps;
  count_outside_region();
  if (!is_inside_regions()) search.prune(search.region_bound);
  bool stopped = search.goal == Goal::kFree;  // as soon as the link is free
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    for_each_index(clouds, i, [&](const auto& obstacles) { stopped = !run(obstacles) || stopped; });
  }
  // A search that was stopped may know nothing of what it left.
  const double least = -link_.context.deepest();
  search.pruned_bound = std::max(search.pruned_bound, least);
  search.refined_bound = std::max(search.refined_bound, least);
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
  const double coherent = bound_may_hold()
                              ? std::min(kept.at(search.scene, search.X_FL), search.region_bound)
                              : -kInfinity;
  const double bound = std::max(coherent, search.first_bound);
  if (!(bound > search.lower_bound())) return;
  search.pruned_bound = std::max(search.pruned_bound, bound);
  search.refined_bound = std::max(search.refined_bound, bound);
  if (bound > coherent) return;  // it was proven at this pose
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
  const double rounding = kFloatError * (coordinate + range) +
                          pose_error(search.drift, extent, range) + search.index_error;
  // A float, as far as there are any: what is added to bounds in float is taken off in double.
  const auto as_float = static_cast<double>(round_up(rounding));
  search.rounding = std::max(search.rounding, std::isfinite(as_float) ? as_float : rounding);
}
template void LinkQuery::enter(const PointObstacles& obstacles);
template void LinkQuery::enter(const BoxObstacles& obstacles);

double LinkQuery::extent() const {
  const InnerSphereTree& tree = link_.context.tree();
  return tree.center().norm() + tree.radius();
}

// Whether a bound from another pose may hold: near holes it does not where a point is inside.
bool LinkQuery::bound_may_hold() const {
  return link_.search.closest.exact.distance > 0.0 || link_.context.solid().is_closed();
}

// Whether the bound that was proven at another pose is enough at this one.
bool LinkQuery::is_settled(SnapshotSpan clouds) {
  LinkSearch& search = link_.search;
  const InnerSphereTree& tree = link_.context.tree();
  search.region_bound = kInfinity;
  for (const CloudSnapshot* cloud : clouds) {
    const RegionOfInterest& region = cloud->region;
    const double from_center = (search.X_FL * tree.center() - region.center_F).norm();
    const double beyond = std::max(region.radius - from_center, 0.0);
    // A mesh with holes may enclose places beyond the region.
    const bool may_be_inside =
        !link_.context.solid().is_closed() && beyond <= tree.radius() + tree.interior_gap();
    search.region_bound = std::min(
        search.region_bound, may_be_inside ? -link_.context.deepest() : beyond - tree.radius());
  }
  search.region_bound -= pose_error(search.drift, extent(), 0.0);
  const LinkBound& kept = link_.kept.bound;
  const double bound = kept.at(search.scene, search.X_FL);
  const bool is_enough = bound >= search.prune_bound() - kDistanceRounding ||
                         (search.goal == Goal::kFree && bound > 0.0);
  if (!is_enough || !is_inside_regions() || !bound_may_hold()) return false;
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

// All that is kept is about the geometry, but for the terms of the last answer.
void LinkQuery::set_link(const LinkModel& link) {
  LinkContext& context = link_.context;
  const bool is_same = link.packing_id != 0 && link.packing_id == context.model->packing_id;
  context.model = &link;
  if (is_same) return;
  context.displacement = DisplacementBound(link);
  LinkCoherence& kept = link_.kept;
  kept.bound.set_link(link);
  kept.extents.set_link(link);
  kept.answered.scene = kUnknownScene;
}

void LinkQuery::keep_bound() {
  const LinkSearch& search = link_.search;
  double bound = search.lower_bound() - search.index_error;
  // Float loses more, the farther.
  if (bound > search.range()) bound -= kFloatError * (bound - search.range());
  // The margin is that of points beyond the regions, too.
  const double outside =
      std::min(search.outside_bound, search.region_bound - link_.context.tree().interior_gap());
  link_.kept.bound.prove(search.scene, search.X_FL, bound, outside, search.max_coordinate);
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
  // Written so that nothing is in range of a pose that is not finite.
  if (!is_in_range()) {
    // UNKNOWN where nothing was measured and not all is known: a box whose side is not decided, in
    // the opening of a mesh with holes, may be inside, though its surface is out of range.
    if (!search.is_complete || !is_inside_regions() || may_be_inside()) return;
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
  last.X_FL = search.X_FL;
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
