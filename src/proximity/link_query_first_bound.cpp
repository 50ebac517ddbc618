// The lower bound to begin with, where none is kept: by few spheres, or by supporting planes.

#include "proximity/link_query.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <type_traits>

#include "proximity/first_bound.h"
#include "proximity/separating_planes.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A link that is nearer than so many radii of its bounding sphere gets its first bound by more and
// smaller spheres.
constexpr double kFineSpheresWithin = 0.5;
// Nodes that are divided for a first bound by a supporting plane.
constexpr int kQuickSteps = 16;
// [m] A link that no first bound was found for is tried again when it has moved so far.
constexpr double kFirstBoundAgain = 0.02;

}  // namespace

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

void LinkQuery::prove_bound_late(SnapshotSpan clouds, Deadline* deadline, double late) {
  const LinkSearch& search = link_.search;
  if (search.is_complete || search.lower_bound() > 0.0 || !(search.closest.exact.distance > 0.0)) {
    return;
  }
  prove_first_bound(clouds, deadline, late);
  take_kept_bound();
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

}  // namespace ist
