#include "medial_sphere.h"

#include <algorithm>
#include <cmath>

namespace ist {
namespace {

constexpr int kMaxShrinks = 40;
constexpr int kMaxTurns = 6;
constexpr int kMaxGaps = 6;   // of decreasing size that are tried at a surface point
constexpr int kMaxTries = 8;  // searches while holes refuse what was found

}  // namespace

MedialSphereFinder::MedialSphereFinder(const TriangleBvh& bvh, HoleObstacles* holes,
                                       const SphereSearch* taken)
    : bvh_(bvh), holes_(*holes), taken_(taken), size_(bvh.bounds().sizes().norm()) {}

MedialSphereFinder::Obstacle MedialSphereFinder::nearest(const Eigen::Vector3d& x) const {
  const ClosestPoint surface = bvh_.closest(x);
  Obstacle obstacle{surface.point, surface.point, 0.0, std::sqrt(surface.distance_sq)};
  const HoleObstacles::Obstacle hole = holes_.nearest(x, obstacle.distance);
  if (hole.distance < obstacle.distance) {
    obstacle = {hole.center, hole.center, hole.radius, hole.distance};
  }
  if (taken_ != nullptr && taken_->size() > 0) {
    const SphereSearch::Match match = taken_->best(&x, 1, 0);
    if (match.cost < obstacle.distance) {
      const Eigen::Vector3d& center = taken_->center(match.sphere);
      obstacle = {center, center, taken_->weight(match.sphere), match.cost};
    }
  }
  if (obstacle.radius <= 0.0) return obstacle;
  const Eigen::Vector3d away = x - obstacle.center;
  const double norm = away.norm();
  if (norm > 0.0) obstacle.contact += obstacle.radius / norm * away;
  return obstacle;
}

// Every obstacle bounds t from above: the sphere about s + t d that comes within `gap` of s must
// not overlap it. The nearest obstacle again and again shrinks t to the largest that all of them
// allow.
MedialSphere MedialSphereFinder::shrink_along(const Eigen::Vector3d& direction,
                                              const Eigen::Vector3d& s, double gap,
                                              Eigen::Vector3d* contact) const {
  double t = size_ + gap;
  const double accuracy = 1e-3 * gap;
  for (int i = 0; i < kMaxShrinks; ++i) {
    const Eigen::Vector3d center = s + t * direction;
    const Obstacle obstacle = nearest(center);
    *contact = obstacle.contact;
    MedialSphere sphere{center, std::max(0.0, obstacle.distance)};
    if (obstacle.distance >= t - gap - accuracy || t <= gap) return sphere;
    // |s + t d - q| >= t - gap + r, solved for t.
    const Eigen::Vector3d from_center = s - obstacle.center;
    const double offset = obstacle.radius - gap;
    const double denominator = offset - direction.dot(from_center);
    if (denominator <= 0.0) return sphere;
    t = std::max(gap, (from_center.squaredNorm() - offset * offset) / (2.0 * denominator));
  }
  const Eigen::Vector3d center = s + t * direction;
  const Obstacle obstacle = nearest(center);
  *contact = obstacle.contact;
  return {center, std::max(0.0, obstacle.distance)};
}

// Turns the ray away from the contact that stopped the sphere, as long as the sphere grows.
MedialSphere MedialSphereFinder::best_direction(const Eigen::Vector3d& s,
                                                const Eigen::Vector3d& direction,
                                                double gap) const {
  Eigen::Vector3d contact;
  MedialSphere best = shrink_along(direction, s, gap, &contact);
  Eigen::Vector3d best_contact = contact;
  double turn = 1.0;
  for (int i = 0; i < kMaxTurns; ++i) {
    const Eigen::Vector3d from_s = best.center - s, from_contact = best.center - best_contact;
    if (from_contact.norm() < 1e-12 || from_s.norm() < 1e-12) break;
    const Eigen::Vector3d ray = from_s.normalized() + turn * from_contact.normalized();
    if (ray.norm() < 1e-3) break;  // the contacts are antipodal: the sphere is a largest one
    const MedialSphere sphere = shrink_along(ray.normalized(), s, gap, &contact);
    if (sphere.radius > 1.02 * best.radius) {
      best = sphere;
      best_contact = contact;
    } else {
      turn *= 0.4;
      if (turn < 0.1) break;
    }
  }
  return best;
}

MedialSphere MedialSphereFinder::near_surface(const Eigen::Vector3d& s,
                                              const Eigen::Vector3d& normal, double gap) const {
  MedialSphere nothing{s, 0.0};
  if (normal.isZero()) return nothing;
  // The winding number decides which side is inside: faces may be inside out.
  const double step = 1e-3 * gap;
  const bool behind = bvh_.is_inside(s - step * normal);
  const bool before = bvh_.is_inside(s + step * normal);
  // No sphere comes nearer to s than the depth of s in a hole obstacle.
  const double depth = -holes_.nearest(s, 0.0).distance;
  MedialSphere best = nothing;
  // A gap larger than the part's thickness can lead to its other side; a smaller gap follows.
  for (int i = 0; i < kMaxGaps && best.radius == 0.0 && gap >= depth; ++i, gap *= 0.4) {
    if (!holes_.keeps_on()) return nothing;
    for (const double side : {-1.0, 1.0}) {
      if (side < 0.0 ? !behind : !before) continue;
      const MedialSphere sphere = best_direction(s, side * normal, gap);
      // Each call must close the gap at s, so the point itself is better than a farther sphere.
      const bool is_near = (sphere.center - s).norm() - sphere.radius <= 1.01 * gap;
      if (is_near && sphere.radius > best.radius && bvh_.is_inside(sphere.center)) best = sphere;
    }
  }
  return best;
}

MedialSphere MedialSphereFinder::containing(const Eigen::Vector3d& x, double gap) const {
  for (int i = 0; i < kMaxTries; ++i) {
    const Obstacle obstacle = nearest(x);
    const double depth = obstacle.distance;
    if (depth <= 0.0 && !is_closed()) break;
    if (depth < 1e-9) return {x, 0.0};
    Eigen::Vector3d contact;
    const MedialSphere grown =
        shrink_along((x - obstacle.contact) / depth, obstacle.contact, gap, &contact);
    // A sphere that contains x and that no triangle enters is on the same side as x.
    MedialSphere sphere = grown.radius > (grown.center - x).norm() ? grown : MedialSphere{x, depth};
    if (is_closed() || admits(sphere)) return sphere;
  }
  return {x, -std::sqrt(bvh_.closest(x).distance_sq)};
}

}  // namespace ist
