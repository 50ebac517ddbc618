// The exact distances of points.

#include <algorithm>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/outside_margin.h"
#include "proximity/field_search.h"
#include "proximity/refinement.h"

namespace ist {
namespace {

// A query of a link measures cells of its grid when it has measured so many points.
constexpr int kMeasuredBeforeCells = 32;
// Points that are refined, and node pairs that are expanded, before a search counts as crowded. The
// bounds that the single-tree traversal keeps serve longer where there is a tolerance.
constexpr int kCrowdedPoints = 1024, kCrowdedPointsExact = 4096;
constexpr std::uint64_t kCrowdedPairs = 4096;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

float PointRefinement::refine(std::int32_t tile, int lane, float lower_bound) {
  LinkSearch& search = link_.search;
  ++search.refined;
  search.cover_bound =
      std::min(search.cover_bound, static_cast<double>(lower_bound) - search.rounding);
  const ObstacleId id{tile, lane};
  const bool is_late = deadline_passed();
  const bool was_visited = !is_late && !search.visited.insert(id.key());
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id), p_LQ = obstacles_.X_LO * p_OQ;
  const double kept = link_.kept.distances.find(DistanceCache::Quantity::kUnsigned,
                                                coherent_key(obstacles_, id), p_LQ);
  refined_bound_ = round_down(kept);
  if (was_visited) return search.traversal_prune_bound();
  const double bound = std::max(kept, grid_bound({p_LQ}, search.prune_bound()).surface_distance);
  if (bound >= search.prune_bound()) {
    search.prune(bound);
    refined_bound_ = round_down(bound);
  } else if (is_late) {
    // The bound is that of one part of the link; the others are in pairs of their own.
    search.prune(static_cast<double>(lower_bound) - search.rounding);
  } else {
    refined_bound_ = round_down(measure_outside(id, p_OQ, p_LQ));
  }
  return search.traversal_prune_bound();
}

float PointRefinement::measure_near(std::int32_t tile, int lane, float max_distance) {
  const ObstacleId id{tile, lane};
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id);
  measure_outside(id, p_OQ, obstacles_.X_LO * p_OQ, static_cast<double>(max_distance));
  return link_.search.traversal_prune_bound();
}

bool PointRefinement::is_crowded(std::uint64_t node_pairs) const {
  const LinkSearch& search = link_.search;
  if (search.measured < kMeasuredBeforeCells || !link_.context.solid().is_closed()) return false;
  const bool is_exact = search.config.tolerance == 0.0 && search.config.relative_tolerance == 0.0;
  return node_pairs > kCrowdedPairs ||
         search.refined > (is_exact ? kCrowdedPointsExact : kCrowdedPoints);
}

float PointRefinement::bound_box(std::int32_t slot, std::int32_t child, const float* min,
                                 const float* max, double enough) {
  constexpr float kNone = -std::numeric_limits<float>::infinity();
  LinkSearch& search = link_.search;
  if (search.measured < kMeasuredBeforeCells || !link_.context.solid().is_closed()) return kNone;
  const Eigen::Vector3d low(min[0], min[1], min[2]), high(max[0], max[1], max[2]);
  SignedDistanceGrid::Part part;
  part.half = 0.5 * (high - low);
  part.radius = part.half.norm();
  if (part.radius > link_.context.grid.plane_radius()) return kNone;
  float* known = search.box_bounds.find(slot);
  if (known != nullptr) return *known;
  const Eigen::Matrix3d R_LO = obstacles_.X_LO.linear();
  part.R_LO = &R_LO;
  part.center_O = 0.5 * (low + high);
  part.center_L = obstacles_.X_LO * part.center_O;
  PointTile scratch;
  if (child < 0) part.points = &obstacles_.bvh->tile(static_cast<std::size_t>(~child), &scratch);
  const SignedDistanceGrid::Bound bound = grid_bound(part, enough);
  return search.box_bounds.insert(slot,
                                  bound.is_outside ? round_down(bound.signed_distance) : kNone);
}

// What needs no winding number. After the deadline there is no time to measure a cell's margin.
PointRefinement::Side PointRefinement::known_side(ObstacleId id, const Eigen::Vector3d& p_LQ) {
  if (link_.kept.distances.find(DistanceCache::Quantity::kOutside, coherent_key(obstacles_, id),
                                p_LQ) > 0.0) {
    return Side::kOutside;
  }
  SignedDistanceGrid& grid = link_.context.grid;
  SignedDistanceGrid::Cell* cell = grid.find(p_LQ);
  if (cell == nullptr || deadline_passed()) return Side::kUnknown;
  const bool is_outside =
      grid.bound(cell, {p_LQ}, kInfinity).is_outside || grid.outside_margin(cell, {p_LQ}) > 0.0;
  return is_outside ? Side::kOutside : Side::kUnknown;
}

// The winding number is asked last. It is not asked after the deadline.
SideBalls::Found PointRefinement::side(ObstacleId id, const Eigen::Vector3d& p_LQ,
                                       double least_distance) {
  SideBalls& balls = link_.kept.side_balls;
  SideBalls::Found found = balls.find(p_LQ);
  if (found.side != Side::kUnknown) return found;
  const SignedDistanceGrid::Bound bound = grid_bound({p_LQ}, kInfinity);
  if (bound.is_outside || known_side(id, p_LQ) == Side::kOutside) return {Side::kOutside, 0.0};
  if (deadline_passed()) return found;
  link_.search.count_exact();
  const Solid& solid = link_.context.solid();
  const double distance = std::max(bound.surface_distance, least_distance);
  const SideMargin measured =
      solid.is_closed() || !is_one_mesh(solid)
          ? SideMargin{solid.is_inside(p_LQ), solid.is_closed() ? distance : 0.0}
          : side_margin(solid, p_LQ, distance);
  found = {measured.is_inside ? Side::kInside : Side::kOutside, measured.margin};
  balls.store(p_LQ, found);
  if (!measured.is_inside && measured.margin > 0.0) {
    link_.kept.distances.store(DistanceCache::Quantity::kOutside, coherent_key(obstacles_, id),
                               p_LQ, measured.margin);
  }
  return found;
}

bool PointRefinement::is_surface_within(std::int32_t tile, int lane, float distance) {
  const Solid& solid = link_.context.solid();
  if (!is_one_mesh(solid)) return false;
  link_.search.count_exact();
  const Eigen::Vector3d p_LQ = obstacles_.X_LO * point_O(*obstacles_.bvh, {tile, lane});
  return is_within_distance(solid, p_LQ, static_cast<double>(distance));
}

// A cell costs as much as a few points: where few have to be measured, it does not pay. After the
// deadline there is no time for one, nor for its plane.
SignedDistanceGrid::Bound PointRefinement::grid_bound(const SignedDistanceGrid::Part& part,
                                                      double enough) {
  SignedDistanceGrid& grid = link_.context.grid;
  SignedDistanceGrid::Cell* cell = grid.find(part.center_L);
  if (cell == nullptr && link_.search.measured >= kMeasuredBeforeCells && !deadline_passed()) {
    cell = grid.measure(part.center_L);
  }
  if (cell == nullptr) return {};
  return grid.bound(cell, part, link_.search.deadline->has_passed() ? -kInfinity : enough);
}

bool PointRefinement::update_planes(SupportingPlanes* planes) {
  return update_supporting_planes(obstacles_.X_OL, &link_, planes);
}

void PointRefinement::measure(ObstacleId id, double max_distance) {
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id), p_LQ = obstacles_.X_LO * p_OQ;
  const InnerSphereTree& tree = link_.context.tree();
  if (tree.cover_distance_exceeds(p_LQ, tree.interior_gap())) {
    measure_outside(id, p_OQ, p_LQ, max_distance);
    return;
  }
  switch (cheapest_side(id, p_LQ, &max_distance)) {
    case Side::kOutside:
      measure_outside(id, p_OQ, p_LQ, max_distance);
      return;
    case Side::kInside:
      measure_inside(id, p_OQ, p_LQ, max_distance);
      return;
    case Side::kUnknown:
      link_.search.count_exact();
      link_.search.offer(link_.context.solid().signed_distance(p_LQ), p_OQ, obstacles_, id);
  }
}

// By the field, or else by what side() asks.
// @param max_distance  [m] reduced to what the field tells
PointRefinement::Side PointRefinement::cheapest_side(ObstacleId id, const Eigen::Vector3d& p_LQ,
                                                     double* max_distance) {
  const DistanceField* field = link_.context.field();
  double least_distance = 0.0;
  if (field != nullptr) {
    const FieldPlace place = look_up_field(*field, p_LQ, round_up(link_.search.rounding));
    *max_distance = std::min(*max_distance, static_cast<double>(place.within));
    if (place.outside > 0.0F) return Side::kOutside;
    least_distance = static_cast<double>(place.surface);
  }
  return side(id, p_LQ, least_distance).side;
}

// While another point is known to be inside, it matters only whether this one is deeper.
void PointRefinement::measure_inside(ObstacleId id, const Eigen::Vector3d& p_OQ,
                                     const Eigen::Vector3d& p_LQ, double within) {
  LinkSearch& search = link_.search;
  search.count_exact();
  const double deepest = std::max(-search.prune_bound(), 0.0);
  const PointDepth found =
      point_depth(link_.context.solid(), p_LQ, deepest, {within, Side::kInside});
  if (found.exact.distance < kInfinity) {
    search.offer(found.exact, p_OQ, obstacles_, id);
  } else {
    search.prune(std::max(found.floor, -deepest));
  }
}

double PointRefinement::measure_outside(ObstacleId id, const Eigen::Vector3d& p_OQ,
                                        const Eigen::Vector3d& p_LQ, double max_distance) {
  LinkSearch& search = link_.search;
  search.count_exact();
  const double limit = std::min({search.closest.exact.distance, search.other_links,
                                 search.range() + search.rounding, max_distance});
  const bool has_closest = search.closest.exact.distance < kInfinity;
  double lower_bound;
  const SignedDistance exact = distance_outside(
      link_.context.solid(), p_LQ, limit,
      has_closest ? search.closest.exact.normal : link_.kept.plane_normal_L, 0.0, &lower_bound);
  link_.kept.distances.store(DistanceCache::Quantity::kUnsigned, coherent_key(obstacles_, id), p_LQ,
                             lower_bound);
  if (lower_bound < exact.distance) {
    search.refined_bound = std::min(search.refined_bound, lower_bound);
  }
  search.offer(exact, p_OQ, obstacles_, id);
  return lower_bound;
}

}  // namespace ist
