// The exact distances of solid boxes, and the depth of those that overlap the link.

#include <algorithm>
#include <array>
#include <limits>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/outside_margin.h"
#include "proximity/obstacle_measure.h"
#include "proximity/overlap_descent.h"

namespace ist {
namespace {

// [m] Where box and surface meet, steps of these lengths inward decide whether they overlap.
constexpr std::array<double, 3> kSteps = {1e-3, 1e-4, 1e-6};
// [m] A box is measured up to this far behind what matters now: so it need not be measured again
// until the link has moved about as far.
constexpr double kBehind = 0.005;
// [m] Parts of boxes that cannot be deeper than what was found by more than this are not divided.
constexpr double kDepthResolution = 5e-4;

Eigen::AlignedBox3d box_of(const SearchEntry& entry) {
  return {Eigen::Vector3d(entry.min[0], entry.min[1], entry.min[2]),
          Eigen::Vector3d(entry.max[0], entry.max[1], entry.max[2])};
}

double radius_of(const Eigen::AlignedBox3d& box) { return 0.5 * box.sizes().norm(); }

}  // namespace

// [m] What is farther does not matter, nor will it at the next poses.
double BoxMeasure::useful_distance() const {
  const LinkSearch& search = link_.search;
  return std::max(std::min(search.closest.exact.distance, search.range() + search.rounding), 0.0) +
         kBehind;
}

BoxDistance BoxMeasure::measure_distance(const Eigen::AlignedBox3d& box, double limit,
                                         const std::optional<Eigen::Vector3d>& near_O) const {
  ++link_.search.statistics->exact_evaluations;
  return distance_to_box(link_.context.solid(), box, obstacles_.X_OL, limit, near_O);
}

// Whether all of a box, which the surface does not meet, is outside: by its cover distance, or by
// how far from its centre all places are outside.
bool BoxMeasure::is_outside(const Eigen::AlignedBox3d& box) const {
  const InnerSphereTree& tree = link_.context.tree();
  const Eigen::Vector3d p_LC = obstacles_.X_LO * box.center();
  const double radius = radius_of(box);
  if (tree.cover_distance_exceeds(p_LC, tree.interior_gap() + radius)) return true;
  const SideMargin side = outside_margin(link_.context.solid(), p_LC, 1.001 * radius);
  return !side.is_inside && side.margin > radius;
}

float BoxMeasure::measure_outside(const SearchEntry& entry, float /*rounding*/) {
  const Eigen::AlignedBox3d box = box_of(entry);
  const BoxDistance found = measure_distance(box, useful_distance());
  if (found.distance > 0.0) {
    take_outside(found, id_of(entry));
  } else {
    take_overlap(box, found, id_of(entry));
  }
  return round_down(std::min(found.lower_bound, found.distance));
}

BoxMeasure::Found BoxMeasure::measure_box(SearchEntry* entry) {
  const Eigen::AlignedBox3d box = box_of(*entry);
  const ObstacleId id = id_of(*entry);
  const BoxDistance found = measure_distance(box, useful_distance());
  entry->distance = round_down(std::min(found.lower_bound, found.distance));
  if (found.distance > 0.0 && is_outside(box)) {
    take_outside(found, id);
    return {true, entry->distance};
  }
  const float bound = measure_part(*entry);
  if (found.distance == 0.0 && static_cast<double>(bound) < link_.search.prune_bound()) {
    take_overlap(box, found, id);
  } else if (found.distance > 0.0 && found.distance < kInfinity &&
             !link_.context.solid().is_closed()) {
    take_point(found.p_OB, id);
  }
  return {false, bound};
}

// @returns [m] no point of the part has a smaller signed distance
float BoxMeasure::measure_part(const SearchEntry& entry) {
  const Eigen::AlignedBox3d part = box_of(entry);
  const Solid& solid = link_.context.solid();
  const Eigen::Vector3d p_OQ = part.center(), p_LQ = obstacles_.X_LO * p_OQ;
  ++link_.search.statistics->exact_evaluations;
  const SignedDistance measured = solid.signed_distance(p_LQ);
  link_.search.offer(measured, p_OQ, obstacles_, id_of(entry));
  // Through the opening of a mesh with holes, a part of a box that meets no surface may be inside.
  if (measured.distance > 0.0 && entry.distance > 0.0F && is_outside(part)) {
    return std::max(round_down(measured.distance - radius_of(part)), entry.distance);
  }
  return round_down(distance_floor(solid, p_LQ, measured) - radius_of(part));
}

bool BoxMeasure::may_divide(float bound) const {
  const LinkSearch& search = link_.search;
  const double distance = search.closest.exact.distance;
  const bool matters =
      static_cast<double>(bound) < distance - (distance < 0.0 ? kDepthResolution : 0.0);
  return matters && search.box_cells_left >= 2;
}

std::array<float, 2> BoxMeasure::divide(std::array<SearchEntry, 2>* halves) {
  auto& [low, high] = *halves;
  Eigen::Index axis;
  const Eigen::AlignedBox3d whole = box_of(low);
  whole.sizes().maxCoeff(&axis);
  low.max[axis] = high.min[axis] = static_cast<float>(whole.center()[axis]);
  std::array<float, 2> bounds{};
  for (std::size_t i = 0; i < 2; ++i) {
    SearchEntry& half = (*halves)[i];
    half.is_part = true;
    bounds[i] = measure_part(half);
    --link_.search.box_cells_left;
  }
  return bounds;
}

void BoxMeasure::measure(ObstacleId id, double max_distance,
                         const std::optional<Eigen::Vector3d>& near_O) {
  const Eigen::AlignedBox3d box = box_O(*obstacles_.bvh, id);
  const BoxDistance found = measure_distance(box, max_distance, near_O);
  if (!(found.distance > 0.0)) return take_overlap(box, found, id);
  const InnerSphereTree& tree = link_.context.tree();
  const Eigen::Vector3d p_LC = obstacles_.X_LO * box.center();
  // The box as a whole may be inside.
  if (!tree.cover_distance_exceeds(p_LC, tree.interior_gap())) take_point(box.center(), id);
  take_outside(found, id);
}

void BoxMeasure::take_outside(const BoxDistance& found, ObstacleId id) {
  LinkSearch& search = link_.search;
  const double upper_bound = search.closest.exact.distance;
  if (found.lower_bound < std::min(found.distance, upper_bound)) search.prune(found.lower_bound);
  if (!(found.distance < upper_bound)) return;
  SignedDistance exact;
  exact.distance = found.distance;
  exact.witness = obstacles_.X_LO * found.p_OS;
  exact.normal = (obstacles_.X_LO.linear() * (found.p_OB - found.p_OS)) / found.distance;
  search.offer(exact, found.p_OB, obstacles_, id);
}

void BoxMeasure::take_point(const Eigen::Vector3d& p_OQ, ObstacleId id) {
  ++link_.search.statistics->exact_evaluations;
  link_.search.offer(link_.context.solid().signed_distance(obstacles_.X_LO * p_OQ), p_OQ,
                     obstacles_, id);
}

// A box has at least one point in common with the link: that one is taken, and some that are
// deeper.
void BoxMeasure::take_overlap(const Eigen::AlignedBox3d& box, const BoxDistance& found,
                              ObstacleId id) {
  const Eigen::Vector3d p_LQ = obstacles_.X_LO * found.p_OB;
  SignedDistance touch = link_.context.solid().signed_distance(p_LQ);
  touch.distance = std::min(touch.distance, 0.0);  // what rounding has put outside touches
  if (touch.distance == 0.0) touch.witness = p_LQ;
  link_.search.offer(touch, found.p_OB, obstacles_, id);
  const Eigen::Vector3d into_link = obstacles_.X_OL.linear() * -touch.normal;
  const Eigen::Vector3d into_box = (box.center() - found.p_OB).stableNormalized();
  for (const double step : kSteps) {
    for (const Eigen::Vector3d& way : {into_link, Eigen::Vector3d(into_link + into_box)}) {
      // A point is no deeper than the one that the step leaves, but for the step's length.
      if (link_.search.closest.exact.distance <= touch.distance - step * way.norm()) continue;
      take_point(clamp_to(box, found.p_OB + step * way), id);
    }
  }
  descend(box, found.p_OB, id);
}

// Looks for a point of a box that is inside the link, from one that both have in common, while none
// is known.
void BoxMeasure::descend(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p_OQ,
                         ObstacleId id) {
  LinkSearch& search = link_.search;
  OverlapDescent descent(box, p_OQ);
  while (!descent.is_finished() && search.closest.exact.distance >= 0.0 &&
         search.descent_steps_left > 0 && !deadline_passed()) {
    --search.descent_steps_left;
    ++search.statistics->exact_evaluations;
    const Eigen::Vector3d p_OP = descent.point();
    const SignedDistance exact = link_.context.solid().signed_distance(obstacles_.X_LO * p_OP);
    search.offer(exact, p_OP, obstacles_, id);
    descent.take(exact.distance, obstacles_.X_OL.linear() * exact.normal);
  }
}

}  // namespace ist
