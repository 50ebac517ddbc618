#include "medial_sphere.h"

#include <algorithm>
#include <cmath>

namespace ist {
namespace {

constexpr int kMaxShrinks = 40;
constexpr int kMaxTurns = 6;
constexpr int kMaxTries = 8;

}  // namespace

MedialSphereFinder::MedialSphereFinder(const TriangleBvh& bvh, HoleGuard* holes,
                                       const SphereSearch* taken)
    : bvh_(bvh), holes_(*holes), taken_(taken), size_(bvh.bounds().sizes().norm()) {}

MedialSphereFinder::Obstacle MedialSphereFinder::nearest(const Eigen::Vector3d& x) const {
  const ClosestPoint surface = bvh_.closest(x);
  Obstacle obstacle{surface.point, surface.point, 0.0, std::sqrt(surface.distance_sq)};
  const HoleGuard::Obstacle hole = holes_.nearest(x, obstacle.distance);
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

MedialSphereFinder::InnerSphere MedialSphereFinder::along(const Eigen::Vector3d& s,
                                                          const Eigen::Vector3d& direction,
                                                          double slack,
                                                          Eigen::Vector3d* contact) const {
  // Every obstacle bounds t: the sphere about s + t d that reaches to within slack of s must not
  // reach into it. Taking the nearest again and again shrinks t to the largest that all allow.
  double t = size_ + slack;
  const double accuracy = 1e-3 * slack;
  for (int i = 0; i < kMaxShrinks; ++i) {
    const Eigen::Vector3d center = s + t * direction;
    const Obstacle obstacle = nearest(center);
    *contact = obstacle.contact;
    const InnerSphere sphere{center, std::max(0.0, obstacle.distance)};
    if (obstacle.distance >= t - slack - accuracy || t <= slack) return sphere;
    // |s + t d - q| >= t - slack + r, solved for t.
    const Eigen::Vector3d from_center = s - obstacle.center;
    const double reach = obstacle.radius - slack;
    const double along_ray = reach - direction.dot(from_center);
    if (along_ray <= 0.0) return sphere;
    t = std::max(slack, (from_center.squaredNorm() - reach * reach) / (2.0 * along_ray));
  }
  const Eigen::Vector3d center = s + t * direction;
  const Obstacle obstacle = nearest(center);
  *contact = obstacle.contact;
  return {center, std::max(0.0, obstacle.distance)};
}

MedialSphereFinder::InnerSphere MedialSphereFinder::turned(const Eigen::Vector3d& s,
                                                           const Eigen::Vector3d& direction,
                                                           double slack) const {
  Eigen::Vector3d contact;
  InnerSphere best = along(s, direction, slack, &contact);
  Eigen::Vector3d best_contact = contact;
  double turn = 1.0;
  for (int i = 0; i < kMaxTurns; ++i) {
    const Eigen::Vector3d from_s = best.center - s, from_contact = best.center - best_contact;
    if (from_contact.norm() < 1e-12 || from_s.norm() < 1e-12) break;
    const Eigen::Vector3d ray = from_s.normalized() + turn * from_contact.normalized();
    if (ray.norm() < 1e-3) break;  // contacts face each other: already as large as it gets
    const InnerSphere sphere = along(s, ray.normalized(), slack, &contact);
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

MedialSphereFinder::InnerSphere MedialSphereFinder::at_surface(const Eigen::Vector3d& s,
                                                               const Eigen::Vector3d& normal,
                                                               double slack) const {
  const InnerSphere nothing{s, 0.0};
  if (normal.isZero()) return nothing;
  // Which side is inside is asked of the winding number: faces may be inside out.
  const double step = 1e-3 * slack;
  const bool behind = bvh_.is_inside(s - step * normal);
  const bool before = bvh_.is_inside(s + step * normal);
  // No sphere comes nearer to s than out of the obstacle that s is in.
  const double depth = -holes_.nearest(s, 0.0).distance;
  InnerSphere best = nothing;
  // A slack beyond the part's thickness can lead to the other side of it.
  for (int i = 0; i < 6 && best.radius == 0.0 && slack >= depth; ++i, slack *= 0.4) {
    for (const double side : {-1.0, 1.0}) {
      if (side < 0.0 ? !behind : !before) continue;
      const InnerSphere sphere = turned(s, side * normal, slack);
      // Better the point itself than a sphere that ends short of it: each call must close its gap.
      const bool is_near = (sphere.center - s).norm() - sphere.radius <= 1.01 * slack;
      if (is_near && sphere.radius > best.radius && bvh_.is_inside(sphere.center)) best = sphere;
    }
  }
  return best;
}

MedialSphereFinder::InnerSphere MedialSphereFinder::around(const Eigen::Vector3d& x,
                                                           double slack) const {
  for (int i = 0; i < kMaxTries; ++i) {
    const Obstacle obstacle = nearest(x);
    const double depth = obstacle.distance;
    if (depth <= 0.0 && !is_closed()) break;
    if (depth < 1e-9) return {x, 0.0};
    Eigen::Vector3d contact;
    const InnerSphere grown =
        along(obstacle.contact, (x - obstacle.contact) / depth, slack, &contact);
    // A sphere that holds x and crosses nothing is on the same side as x.
    const InnerSphere sphere =
        grown.radius > (grown.center - x).norm() ? grown : InnerSphere{x, depth};
    if (is_closed() || admits(sphere)) return sphere;
  }
  return {x, -std::sqrt(bvh_.closest(x).distance_sq)};
}

}  // namespace ist
