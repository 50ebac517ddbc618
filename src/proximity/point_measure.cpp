// The exact distances of points, and their sides.

#include <algorithm>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/outside_margin.h"
#include "proximity/obstacle_measure.h"

namespace ist {
namespace {

Eigen::Vector3d place_of(const SearchEntry& point) {
  return Eigen::Vector3d(point.min[0], point.min[1], point.min[2]);
}

}  // namespace

float PointMeasure::measure_outside(const SearchEntry& point, float rounding) {
  const Eigen::Vector3d p_OQ = place_of(point);
  return round_down(measure_outside(id_of(point), p_OQ, obstacles_.X_LO * p_OQ,
                                    static_cast<double>(point.radius + rounding)));
}

float PointMeasure::measure_inside(const SearchEntry& point, float rounding) {
  const Eigen::Vector3d p_OQ = place_of(point);
  return round_down(measure_inside(id_of(point), p_OQ, obstacles_.X_LO * p_OQ,
                                   static_cast<double>(point.radius + rounding)));
}

SideBalls::Found PointMeasure::known_side(const SearchEntry& point) const {
  return link_.kept.side_balls.find(
      Eigen::Vector3d(point.center[0], point.center[1], point.center[2]));
}

SideBalls::Found PointMeasure::ask_side(const SearchEntry& point, float least_distance) {
  return side(obstacles_.X_LO * place_of(point), static_cast<double>(least_distance));
}

// The winding number is asked last. It is not asked after the deadline.
SideBalls::Found PointMeasure::side(const Eigen::Vector3d& p_LQ, double least_distance) {
  SideBalls& balls = link_.kept.side_balls;
  SideBalls::Found found = balls.find(p_LQ);
  if (found.side != Side::kUnknown || deadline_passed()) return found;
  ++link_.search.statistics->exact_evaluations;
  const Solid& solid = link_.context.solid();
  const double distance = std::max(least_distance, 0.0);
  const SideMargin measured = side_margin(solid, p_LQ, distance);
  found = {measured.is_inside ? Side::kInside : Side::kOutside, measured.margin};
  balls.store(p_LQ, found);
  return found;
}

bool PointMeasure::is_surface_within(const SearchEntry& point, float distance) const {
  const Solid& solid = link_.context.solid();
  if (!is_one_mesh(solid)) return false;
  ++link_.search.statistics->exact_evaluations;
  return is_within_distance(solid, obstacles_.X_LO * place_of(point),
                            static_cast<double>(distance));
}

void PointMeasure::measure(ObstacleId id, double max_distance) {
  const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id), p_LQ = obstacles_.X_LO * p_OQ;
  const InnerSphereTree& tree = link_.context.tree();
  if (tree.cover_distance_exceeds(p_LQ, tree.interior_gap())) {
    measure_outside(id, p_OQ, p_LQ, max_distance);
    return;
  }
  switch (cheapest_side(p_LQ, &max_distance)) {
    case Side::kOutside:
      measure_outside(id, p_OQ, p_LQ, max_distance);
      return;
    case Side::kInside:
      measure_inside(id, p_OQ, p_LQ, max_distance);
      return;
    case Side::kUnknown:
      ++link_.search.statistics->exact_evaluations;
      link_.search.offer(link_.context.solid().signed_distance(p_LQ), p_OQ, obstacles_, id);
  }
}

// By the field, or else by what side() asks.
// @param max_distance  [m] reduced to what the field tells
PointMeasure::Side PointMeasure::cheapest_side(const Eigen::Vector3d& p_LQ, double* max_distance) {
  const DistanceField* field = link_.context.field();
  double least_distance = 0.0;
  if (field != nullptr) {
    const FieldPlace place = look_up_field(*field, p_LQ, round_up(link_.search.rounding));
    *max_distance = std::min(*max_distance, static_cast<double>(place.within));
    if (place.outside > 0.0F) return Side::kOutside;
    least_distance = static_cast<double>(place.surface);
  }
  return side(p_LQ, least_distance).side;
}

// While another point is known to be inside, it matters only whether this one is deeper.
double PointMeasure::measure_inside(ObstacleId id, const Eigen::Vector3d& p_OQ,
                                    const Eigen::Vector3d& p_LQ, double within) {
  LinkSearch& search = link_.search;
  ++search.statistics->exact_evaluations;
  const double deepest = std::max(-search.prune_bound(), 0.0);
  const PointDepth found =
      point_depth(link_.context.solid(), p_LQ, deepest, {within, Side::kInside});
  if (found.exact.distance < kInfinity) {
    search.offer(found.exact, p_OQ, obstacles_, id);
    return found.exact.distance;
  }
  const double bound = std::max(found.floor, -deepest);
  search.prune(bound);
  return bound;
}

double PointMeasure::measure_outside(ObstacleId id, const Eigen::Vector3d& p_OQ,
                                     const Eigen::Vector3d& p_LQ, double max_distance) {
  LinkSearch& search = link_.search;
  ++search.statistics->exact_evaluations;
  const double limit = std::min({search.closest.exact.distance, search.other_links,
                                 search.range() + search.rounding, max_distance});
  const bool has_closest = search.closest.exact.distance < kInfinity;
  double lower_bound;
  const SignedDistance exact = distance_outside(
      link_.context.solid(), p_LQ, limit,
      has_closest ? search.closest.exact.normal : link_.kept.plane.normal_L, 0.0, &lower_bound);
  if (lower_bound < exact.distance) {
    search.refined_bound = std::min(search.refined_bound, lower_bound);
  }
  search.offer(exact, p_OQ, obstacles_, id);
  return lower_bound;
}

}  // namespace ist
