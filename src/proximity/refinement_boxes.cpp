// The exact distances of solid boxes.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "internal/geometry/float_rounding.h"
#include "proximity/overlap_descent.h"
#include "proximity/refinement.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// [m] Where box and surface meet, steps of these lengths inward decide whether they overlap.
constexpr std::array<double, 3> kSteps = {1e-3, 1e-4, 1e-6};

// [m] A box is measured up to this far behind what matters now: so it need not be measured again
// until the link has moved about as far.
constexpr double kBehind = 0.005;

// The key under which the bound of a box is kept: the voxels of the next snapshot are in the same
// places.
std::uint32_t coherent_key(const BoxBvh& bvh, const Eigen::AlignedBox3d& box_O) {
  constexpr double kCell = 0.001;  // [m]
  const Eigen::Vector3d p = (bvh.origin() + box_O.center()) / kCell;
  const auto cell = [&p](int axis) {
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::floor(p[axis])));
  };
  return cell(0) * 73856093U ^ cell(1) * 19349663U ^ cell(2) * 83492791U;
}

}  // namespace

BoxRefinement::Visit::Visit(const BoxObstacles& obstacles, ObstacleId obstacle)
    : id(obstacle),
      box(box_O(*obstacles.bvh, obstacle)),
      key(coherent_key(*obstacles.bvh, box)),
      placed(box, obstacles.X_LO) {}

float BoxRefinement::refine(std::int32_t tile, int lane, float lower_bound) {
  LinkSearch& search = link_.search;
  search.cover_bound =
      std::min(search.cover_bound, static_cast<double>(lower_bound) - search.rounding);
  refined_bound_ = -std::numeric_limits<float>::infinity();
  const ObstacleId id{tile, lane};
  const bool is_new = search.visited.insert(id.key());
  if (!is_new && !search.outside.contains(id.key())) return search.traversal_prune_bound();
  const Visit visit(obstacles_, id);
  BoxDistanceCache::Kept kept = link_.kept.box_distances.find(visit.key, visit.placed);
  if (is_new && kept.lower_bound >= search.prune_bound()) {
    search.prune(kept.lower_bound);
  } else if (is_new) {
    measure_outside(visit, &kept);
  }
  if (kept.is_outside) refined_bound_ = round_down(kept.lower_bound);
  return search.traversal_prune_bound();
}

// A box that the surface does not meet is inside or outside as a whole.
bool BoxRefinement::is_outside(std::int32_t tile, int lane) {
  if (has_holes()) return false;
  LinkSearch& search = link_.search;
  const ObstacleId id{tile, lane};
  if (search.outside.contains(id.key())) return true;
  if (search.boxes_inside.contains(id)) return false;
  if (deadline_passed()) {
    search.boxes_inside.give_up();
    return false;
  }
  const Visit visit(obstacles_, id);
  BoxDistanceCache::Kept kept = link_.kept.box_distances.find(visit.key, visit.placed);
  if (!kept.is_outside) {
    BoxDistance found;
    const bool is_known = kept.lower_bound > 0.0;
    if (!is_known) {
      search.visited.insert(id.key());
      found = measure_distance(visit, std::max(useful_distance(), kBehind), &kept);
    }
    if (kept.lower_bound > 0.0 && is_center_outside(visit)) keep_outside(visit, &kept);
    if (!kept.is_outside) {
      search.boxes_inside.add(id, found);
      return false;
    }
    if (!is_known) take_outside(found, id);
  }
  search.outside.insert(id.key());
  return true;
}

bool BoxRefinement::update_planes(SupportingPlanes* planes) {
  return update_supporting_planes(obstacles_.X_OL, &link_, planes);
}

// [m] What is farther does not matter, nor will it at the next poses.
double BoxRefinement::useful_distance() const {
  const LinkSearch& search = link_.search;
  return std::min(search.closest.exact.distance, search.range() + search.rounding) + kBehind;
}

BoxDistance BoxRefinement::measure_distance(const Visit& visit, double limit,
                                            BoxDistanceCache::Kept* kept,
                                            const std::optional<Eigen::Vector3d>& near_O) {
  ++link_.search.statistics->exact_evaluations;
  const BoxDistance found =
      distance_to_box(link_.context.solid(), visit.box, obstacles_.X_OL, limit, near_O);
  kept->lower_bound = std::min(found.lower_bound, found.distance);
  kept->is_outside = kept->is_outside && kept->lower_bound > 0.0;
  link_.kept.box_distances.store(visit.key, visit.placed, *kept);
  return found;
}

bool BoxRefinement::is_center_outside(const Visit& visit) const {
  return is_far_from_cover(visit) || !link_.context.solid().is_inside(visit.placed.p_LC);
}

// Whether the centre of a box is outside by its cover distance.
bool BoxRefinement::is_far_from_cover(const Visit& visit) const {
  const InnerSphereTree& tree = link_.context.tree();
  return tree.cover_distance_exceeds(visit.placed.p_LC,
                                     tree.interior_gap() + 3.0 * link_.search.rounding);
}

// A box whose cover distance is above the interior gap: if it overlaps the link all the same,
// points of it are measured.
void BoxRefinement::measure_outside(const Visit& visit, BoxDistanceCache::Kept* kept) {
  const BoxDistance found = measure_distance(visit, useful_distance(), kept);
  if (!(found.distance > 0.0)) return take_overlap(found, visit.id);
  take_outside(found, visit.id);
  if (is_far_from_cover(visit)) keep_outside(visit, kept);
}

// A box whose centre is outside a closed link, and which the surface does not meet, is outside.
void BoxRefinement::keep_outside(const Visit& visit, BoxDistanceCache::Kept* kept) {
  if (kept->is_outside || has_holes() || !(kept->lower_bound > 0.0)) return;
  kept->is_outside = true;
  link_.kept.box_distances.store(visit.key, visit.placed, *kept);
}

void BoxRefinement::measure(ObstacleId id, double max_distance,
                            const std::optional<Eigen::Vector3d>& near_O) {
  const Visit visit(obstacles_, id);
  BoxDistanceCache::Kept kept = link_.kept.box_distances.find(visit.key, visit.placed);
  const BoxDistance found = measure_distance(visit, max_distance, &kept, near_O);
  if (!(found.distance > 0.0)) return take_overlap(found, id);
  if (is_far_from_cover(visit)) {
    keep_outside(visit, &kept);
  } else if (!kept.is_outside) {
    take_point(visit.box.center(), id);  // as a whole it may be inside
  }
  take_outside(found, id);
}

void BoxRefinement::take_outside(const BoxDistance& found, ObstacleId id) {
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

void BoxRefinement::take_point(const Eigen::Vector3d& p_OQ, ObstacleId id) {
  ++link_.search.statistics->exact_evaluations;
  link_.search.offer(link_.context.solid().signed_distance(obstacles_.X_LO * p_OQ), p_OQ,
                     obstacles_, id);
}

void BoxRefinement::take_overlap(const BoxDistance& found, ObstacleId id) {
  const Eigen::AlignedBox3d box = box_O(*obstacles_.bvh, id);
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

void BoxRefinement::descend(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p_OQ,
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

void BoxRefinement::take_deepest_in_spheres(std::int32_t leaf, ObstacleId id) {
  const SphereLeaf& spheres = link_.context.tree().leaves()[static_cast<std::size_t>(leaf)];
  const Eigen::AlignedBox3d box = box_O(*obstacles_.bvh, id);
  double deepest = kInfinity;
  Eigen::Vector3d p_OQ = box.center();
  for (int b = 0; b < spheres.count; ++b) {
    const Eigen::Vector3d center_O =
        obstacles_.X_OL * Eigen::Vector3d(spheres.x[b], spheres.y[b], spheres.z[b]);
    const Eigen::Vector3d nearest = clamp_to(box, center_O);
    const double distance =
        (center_O - nearest).norm() - static_cast<double>(spheres.inner_radius[b]);
    if (distance >= deepest) continue;
    deepest = distance;
    p_OQ = nearest;
  }
  take_point(p_OQ, id);
}

}  // namespace ist
