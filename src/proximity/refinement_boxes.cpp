// The exact distances of solid boxes.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "proximity/overlap_descent.h"
#include "proximity/refinement.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// [m] Where box and surface meet, steps of these lengths inward decide whether they overlap.
constexpr std::array<double, 3> kSteps = {1e-6, 1e-4, 1e-3};

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

float BoxRefinement::refine(std::int32_t tile, int lane, float lower_bound) {
  LinkSearch& search = link_.search;
  search.cover_bound =
      std::min(search.cover_bound, static_cast<double>(lower_bound) - search.rounding);
  const ObstacleId id{tile, lane};
  if (!search.visited.insert(id.key())) return search.traversal_prune_bound();
  const Eigen::AlignedBox3d box = box_O(*obstacles_.bvh, id);
  const std::uint32_t key = coherent_key(*obstacles_.bvh, box);
  const PlacedBox placed(box, obstacles_.X_LO);
  const double kept = link_.kept.box_distances.find(key, placed);
  if (kept >= search.prune_bound()) {
    search.prune(kept);
  } else {
    measure_outside(id, key, placed);
  }
  return search.traversal_prune_bound();
}

bool BoxRefinement::update_planes(SupportingPlanes* planes) {
  return update_supporting_planes(obstacles_.X_OL, &link_, planes);
}

// A box whose cover distance is above the interior gap: if it overlaps the link all the same,
// points of it are measured.
void BoxRefinement::measure_outside(ObstacleId id, std::uint32_t key, const PlacedBox& placed) {
  const LinkSearch& search = link_.search;
  ++search.statistics->exact_evaluations;
  const double limit =
      std::min(search.closest.exact.distance, search.range() + search.rounding) + kBehind;
  const BoxDistance found =
      distance_to_box(link_.context.solid(), box_O(*obstacles_.bvh, id), obstacles_.X_OL, limit);
  link_.kept.box_distances.store(key, placed, std::min(found.lower_bound, found.distance));
  if (found.distance > 0.0) {
    take_outside(found, id);
  } else {
    take_overlap(found, id);
  }
}

void BoxRefinement::measure(ObstacleId id, double max_distance) {
  ++link_.search.statistics->exact_evaluations;
  const Eigen::AlignedBox3d box = box_O(*obstacles_.bvh, id);
  const BoxDistance found =
      distance_to_box(link_.context.solid(), box, obstacles_.X_OL, max_distance);
  if (!(found.distance > 0.0)) return take_overlap(found, id);
  const InnerSphereTree& tree = link_.context.tree();
  const Eigen::Vector3d center_O = box.center();  // as a whole it may be inside
  if (tree.cover_distance(obstacles_.X_LO * center_O, 0.0) <= tree.interior_gap()) {
    take_point(center_O, id);
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
    take_point(clamp_to(box, found.p_OB + step * into_link), id);
    take_point(clamp_to(box, found.p_OB + step * (into_link + into_box)), id);
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
