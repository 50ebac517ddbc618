// The upper bound to begin with: an obstacle that the last answer has named, or one near to it.

#include "proximity/link_query.h"

#include "internal/geometry/numbers.h"
#include "proximity/obstacle_measure.h"

namespace ist {
namespace {

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

// Step 1: any obstacle, measured exactly, bounds the distance from above. What was the closest
// point of the link to the last answer's obstacle is still a point of the link.
void LinkQuery::warm_start(SnapshotSpan clouds, bool has_time) {
  if (link_.search.is_answered || begins_with_search()) return;
  const auto& last = link_.kept.last;
  const auto measure_last = [&](const auto& obstacles) {
    if (last.build_id == 0 || obstacles.bvh->build_id() != last.build_id) return;
    enter(obstacles);
    measure_again(obstacles);
  };
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    for_each_index(clouds, i, measure_last);
  }
  if (distance() < kInfinity || !has_time) return;
  // A new cloud has about the same obstacle about the same place, unless the link has left it.
  const auto measure_near = [&](const Eigen::Vector3d& p_FQ) {
    for (std::size_t i = 0; i < clouds.size(); ++i) {
      for_each_index(clouds, i,
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
  PointMeasure(obstacles, &link_)
      .measure({~child, nearest}, (1.0 + 1e-9) * distance + kDistanceRounding);
}

// Boxes have an upper bound of their own.
void LinkQuery::measure_near_place(const BoxObstacles& /*obstacles*/,
                                   const Eigen::Vector3d& /*p_FQ*/) {}

void LinkQuery::measure_again(const PointObstacles& obstacles) {
  const auto& last = link_.kept.last;
  const double distance = (obstacles.X_LO * point_O(*obstacles.bvh, last.id) - last.p_LCl).norm();
  PointMeasure(obstacles, &link_).measure(last.id, (1.0 + 1e-9) * distance + kDistanceRounding);
}

void LinkQuery::measure_again(const BoxObstacles& obstacles) {
  const auto& last = link_.kept.last;
  const Eigen::AlignedBox3d box = box_O(*obstacles.bvh, last.id);
  BoxMeasure measure(obstacles, &link_);
  if (last.was_inside) {
    // The deepest point of a box hardly changes.
    measure.take_point(clamp_to(box, obstacles.X_FO.inverse() * last.p_FCo), last.id);
    if (distance() < 0.0) return;
  }
  const Eigen::Vector3d p_OCl = obstacles.X_OL * last.p_LCl;
  const double distance = (p_OCl - clamp_to(box, p_OCl)).norm();
  measure.measure(last.id, (1.0 + 1e-9) * distance + kDistanceRounding, p_OCl);
}

}  // namespace ist
