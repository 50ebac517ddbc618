#include "volume_share.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "internal/geometry/lens.h"

namespace ist {
namespace {

constexpr double kGridPoints = 60000.0;

double sphere_volume(double radius) { return 4.0 * M_PI / 3.0 * radius * radius * radius; }

/// The share of its volume that a sphere keeps where it overlaps with others.
double kept(const std::vector<InnerSphere>& spheres, std::size_t i) {
  double shared = 0.0;
  for (const InnerSphere& other : spheres) {
    shared +=
        lens_volume(spheres[i].radius, other.radius, (spheres[i].center - other.center).norm());
  }
  return sphere_volume(spheres[i].radius) / shared;
}

/// The sphere of least power.
std::size_t least_power(const std::vector<InnerSphere>& spheres, const Eigen::Vector3d& p) {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const double own =
        (p - spheres[i].center).squaredNorm() - spheres[i].radius * spheres[i].radius;
    if (own >= least) continue;
    least = own;
    best = i;
  }
  return best;
}

/// How much of a grid cell is beyond a surface, as if that were flat and parallel to the grid. All
/// or nothing would miss half a cell along whole faces.
double beyond(double distance, double step) { return std::clamp(0.5 + distance / step, 0.0, 1.0); }

}  // namespace

VolumeShares volume_shares(const std::vector<InnerSphere>& spheres, const Eigen::AlignedBox3d& box,
                           const Solid& solid) {
  std::vector<double> voids(spheres.size(), 0.0);
  const double step = std::cbrt(box.volume() / kGridPoints);
  const Eigen::Array3d counts = (box.sizes().array() / step).ceil().max(1.0);
  const Eigen::Array3d steps = box.sizes().array() / counts;
  for (double x = 0.5; x < counts.x(); ++x) {
    for (double y = 0.5; y < counts.y(); ++y) {
      for (double z = 0.5; z < counts.z(); ++z) {
        const Eigen::Vector3d p = box.min() + (Eigen::Array3d(x, y, z) * steps).matrix();
        const std::size_t i = least_power(spheres, p);
        const double outside = beyond((p - spheres[i].center).norm() - spheres[i].radius, step);
        if (!(outside > 0.0)) continue;
        const double inside = beyond(-solid.signed_distance(p).distance, step);
        // Where a void is thinner than a cell, sphere and surface are about parallel.
        voids[i] += steps.prod() * std::max(outside + inside - 1.0, 0.0);
      }
    }
  }
  VolumeShares shares;
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const double own = sphere_volume(spheres[i].radius), counted = kept(spheres, i) * own;
    shares.share.push_back((counted + voids[i]) / own);
    shares.volume += counted + voids[i];
    shares.packed_volume += counted;
  }
  return shares;
}

}  // namespace ist
