#include "medial_ball.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace ist {
namespace {

constexpr int kMaxShrinks = 40;
constexpr int kMaxTurns = 6;

// Evenly spread on the unit sphere (Fibonacci's spiral): enough to notice a bulge through a hole.
std::vector<Eigen::Vector3d> probe_directions() {
  constexpr int kCount = 150;
  constexpr double kGoldenAngle = 2.39996322972865332;
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < kCount; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / kCount, radius = std::sqrt(1.0 - z * z);
    directions.emplace_back(radius * std::cos(kGoldenAngle * i),
                            radius * std::sin(kGoldenAngle * i), z);
  }
  return directions;
}

}  // namespace

MedialBallFinder::MedialBallFinder(const TriangleBvh& bvh, bool is_closed, const BallSearch* taken)
    : bvh_(bvh), is_closed_(is_closed), taken_(taken), size_(bvh.bounds().sizes().norm()) {}

MedialBallFinder::Obstacle MedialBallFinder::nearest(const Eigen::Vector3d& x) const {
  const ClosestPoint surface = bvh_.closest(x);
  Obstacle obstacle{surface.point, surface.point, 0.0, std::sqrt(surface.distance_sq)};
  if (taken_ == nullptr || taken_->size() == 0) return obstacle;
  const BallSearch::Match match = taken_->best(&x, 1, 0);
  if (match.cost >= obstacle.distance) return obstacle;
  obstacle.center = taken_->center(match.ball);
  obstacle.radius = taken_->weight(match.ball);
  obstacle.distance = match.cost;
  const Eigen::Vector3d away = x - obstacle.center;
  const double norm = away.norm();
  obstacle.contact = obstacle.center;
  if (norm > 0.0) obstacle.contact += obstacle.radius / norm * away;
  return obstacle;
}

MedialBallFinder::InnerBall MedialBallFinder::along(const Eigen::Vector3d& s,
                                                    const Eigen::Vector3d& direction, double slack,
                                                    Eigen::Vector3d* contact) const {
  // Every obstacle bounds t: the ball about s + t d that reaches to within slack of s must not
  // reach into it. Taking the nearest again and again shrinks t to the largest that all allow.
  double t = size_ + slack;
  const double accuracy = 1e-3 * slack;
  for (int i = 0; i < kMaxShrinks; ++i) {
    const Eigen::Vector3d center = s + t * direction;
    const Obstacle obstacle = nearest(center);
    *contact = obstacle.contact;
    const InnerBall ball{center, std::max(0.0, obstacle.distance)};
    if (obstacle.distance >= t - slack - accuracy) return ball;
    // |s + t d - q| >= t - slack + r, solved for t.
    const Eigen::Vector3d from_center = s - obstacle.center;
    const double reach = obstacle.radius - slack;
    const double along_ray = reach - direction.dot(from_center);
    if (along_ray <= 0.0) return ball;
    t = std::max(slack, (from_center.squaredNorm() - reach * reach) / (2.0 * along_ray));
  }
  const Eigen::Vector3d center = s + t * direction;
  const Obstacle obstacle = nearest(center);
  *contact = obstacle.contact;
  return {center, std::max(0.0, obstacle.distance)};
}

MedialBallFinder::InnerBall MedialBallFinder::turned(const Eigen::Vector3d& s,
                                                     const Eigen::Vector3d& direction,
                                                     double slack) const {
  Eigen::Vector3d contact;
  InnerBall best = along(s, direction, slack, &contact);
  Eigen::Vector3d best_contact = contact;
  double turn = 1.0;
  for (int i = 0; i < kMaxTurns; ++i) {
    const Eigen::Vector3d from_s = best.center - s, from_contact = best.center - best_contact;
    if (from_contact.norm() < 1e-12 || from_s.norm() < 1e-12) break;
    const Eigen::Vector3d ray = from_s.normalized() + turn * from_contact.normalized();
    if (ray.norm() < 1e-3) break;  // contacts face each other: already as large as it gets
    const InnerBall ball = along(s, ray.normalized(), slack, &contact);
    if (ball.radius > 1.02 * best.radius) {
      best = ball;
      best_contact = contact;
    } else {
      turn *= 0.4;
      if (turn < 0.1) break;
    }
  }
  return best;
}

MedialBallFinder::InnerBall MedialBallFinder::at_surface(const Eigen::Vector3d& s,
                                                         const Eigen::Vector3d& normal,
                                                         double slack) const {
  const InnerBall nothing{s, 0.0};
  if (normal.isZero()) return nothing;
  // Which side is inside is asked of the winding number: faces may be inside out.
  const double step = 1e-3 * slack;
  const bool behind = bvh_.is_inside(s - step * normal);
  const bool before = bvh_.is_inside(s + step * normal);
  InnerBall best = nothing;
  // A slack beyond the part's thickness can lead to the other side of it.
  for (int i = 0; i < 6 && best.radius == 0.0; ++i, slack *= 0.4) {
    if (behind) best = pulled_inside(s, turned(s, -normal, slack));
    if (before) {
      const InnerBall ball = pulled_inside(s, turned(s, normal, slack));
      if (ball.radius > best.radius) best = ball;
    }
    // Better the point itself than a ball that ends short of it: each call must close its gap.
    if ((best.center - s).norm() - best.radius > 1.01 * slack) best = nothing;
  }
  return best;
}

MedialBallFinder::InnerBall MedialBallFinder::around(const Eigen::Vector3d& x, double slack) const {
  const Obstacle obstacle = nearest(x);
  const double depth = obstacle.distance;
  if (depth < 1e-9) return {x, 0.0};
  Eigen::Vector3d contact;
  const InnerBall grown = along(obstacle.contact, (x - obstacle.contact) / depth, slack, &contact);
  if (grown.radius > (grown.center - x).norm() && bvh_.is_inside(grown.center) && is_inner(grown)) {
    return grown;
  }
  return {x, is_closed_ ? depth : 0.5 * depth};
}

// Through a hole in the mesh a ball may bulge out; smaller ones on the same ray do less.
MedialBallFinder::InnerBall MedialBallFinder::pulled_inside(const Eigen::Vector3d& s,
                                                            InnerBall ball) const {
  const double gap = std::max(0.0, (ball.center - s).norm() - ball.radius);
  if (ball.radius <= 0.0 || !bvh_.is_inside(ball.center)) return {s, 0.0};
  for (int i = 0; i < 20 && ball.radius > 0.0; ++i) {
    if (is_inner(ball)) return ball;
    const double radius = 0.75 * ball.radius;
    ball.center = s + (ball.center - s) * ((radius + gap) / (ball.radius + gap));
    ball.radius = std::clamp(nearest(ball.center).distance, 0.0, radius);
  }
  return {s, 0.0};
}

MedialBallFinder::InnerBall MedialBallFinder::without_bulge(const InnerBall& ball) const {
  InnerBall smaller = ball;
  if (!bvh_.is_inside(ball.center)) smaller.radius = 0.0;
  for (int i = 0; i < 20 && smaller.radius > 0.0; ++i) {
    if (is_inner(smaller)) return smaller;
    smaller.radius *= 0.75;
  }
  return {ball.center, 0.0};
}

bool MedialBallFinder::is_inner(const InnerBall& ball) const {
  if (is_closed_) return true;
  // No triangle is in the ball, so the winding number is harmonic there: its mean over the ball's
  // surface is that at the centre. Near 1, no large part of the surface can be outside.
  const double w = bvh_.winding_number(ball.center);
  if (w > 0.999) return true;
  if (w <= 0.5) return false;
  static const std::vector<Eigen::Vector3d> kDirections = probe_directions();
  return std::all_of(kDirections.begin(), kDirections.end(), [&](const Eigen::Vector3d& d) {
    return bvh_.is_inside(ball.center + ball.radius * d);
  });
}

}  // namespace ist
