#include "volume_share.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <limits>

#include "ist_proximity/geometry/lens.h"

namespace ist {
namespace {

constexpr double kGridPoints = 60000.0;

double ball_volume(double radius) { return 4.0 * M_PI / 3.0 * radius * radius * radius; }

/// The share of its volume that a ball keeps where it overlaps with others.
double kept(const std::vector<Ball>& balls, std::size_t i) {
  double shared = 0.0;
  for (const Ball& other : balls) {
    shared += lens_volume(balls[i].radius, other.radius, (balls[i].center - other.center).norm());
  }
  return ball_volume(balls[i].radius) / shared;
}

/// The ball of least power, and whether it holds the point.
std::size_t least_power(const std::vector<Ball>& balls, const Eigen::Vector3d& p, double* power) {
  std::size_t best = 0;
  *power = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const double own = (p - balls[i].center).squaredNorm() - balls[i].radius * balls[i].radius;
    if (own >= *power) continue;
    *power = own;
    best = i;
  }
  return best;
}

}  // namespace

VolumeShares volume_shares(const std::vector<Ball>& balls, const Solid& solid) {
  Eigen::AlignedBox3d box;
  for (const Ball& ball : balls) {
    box.extend(Eigen::Vector3d(ball.center.array() - ball.cover_radius));
    box.extend(Eigen::Vector3d(ball.center.array() + ball.cover_radius));
  }
  std::vector<double> voids(balls.size(), 0.0);
  const double step = std::cbrt(box.volume() / kGridPoints);
  const Eigen::Array3d counts = (box.sizes().array() / step).ceil().max(1.0);
  const Eigen::Array3d steps = box.sizes().array() / counts;
  for (double x = 0.5; x < counts.x(); ++x) {
    for (double y = 0.5; y < counts.y(); ++y) {
      for (double z = 0.5; z < counts.z(); ++z) {
        const Eigen::Vector3d p = box.min() + (Eigen::Array3d(x, y, z) * steps).matrix();
        double power;
        const std::size_t ball = least_power(balls, p, &power);
        if (power > 0.0 && solid.is_inside(p)) voids[ball] += steps.prod();
      }
    }
  }
  VolumeShares shares;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const double own = ball_volume(balls[i].radius), counted = kept(balls, i) * own;
    shares.share.push_back((counted + voids[i]) / own);
    shares.volume += counted + voids[i];
    shares.packed_volume += counted;
  }
  return shares;
}

}  // namespace ist
