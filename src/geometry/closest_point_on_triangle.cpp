#include "internal/geometry/closest_point_on_triangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

namespace ist {
namespace {

// Squared sine of the angle between two edges below which their normal is not certain.
constexpr double kLeastSineSq = 0.25;
// Smaller squares have lost digits: they are near the least number that double has.
constexpr double kLeastSquare = 1e-280;
// Triangles with less height than this share of their length have no plane.
constexpr double kNoArea = 1e-12;

Eigen::Vector3d closest_on_segment(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b) {
  const Eigen::Vector3d ab = b - a;
  const double length_sq = ab.squaredNorm();
  if (!(length_sq > 0.0)) return a;
  return a + std::clamp((p - a).dot(ab) / length_sq, 0.0, 1.0) * ab;
}

// The closest point of the edges; or the projection onto the plane, where it falls inside the
// triangle and no farther from the edges' closest point than the triangle is high.
Eigen::Vector3d closest_on_sliver(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                  const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const std::array<const Eigen::Vector3d*, 5> corner = {&a, &b, &c, &a, &b};
  Eigen::Vector3d nearest = a;
  std::size_t longest = 0;
  double longest_sq = -1.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d q = closest_on_segment(p, *corner[k], *corner[k + 1]);
    if ((q - p).squaredNorm() < (nearest - p).squaredNorm()) nearest = q;
    const double length_sq = (*corner[k + 1] - *corner[k]).squaredNorm();
    if (length_sq > longest_sq) {
      longest_sq = length_sq;
      longest = k;
    }
  }
  // The two shorter edges give the most certain normal.
  const Eigen::Vector3d& apex = *corner[longest + 2];
  const Eigen::Vector3d n = (*corner[longest] - apex).cross(*corner[longest + 1] - apex);
  const double area = n.norm();
  if (!(area > kNoArea * longest_sq)) return nearest;
  const Eigen::Vector3d normal = n / area, off = p - nearest;
  Eigen::Vector3d projected = p - normal.dot(off) * normal;
  if ((projected - nearest).squaredNorm() * longest_sq > area * area) return nearest;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d edge = *corner[k + 1] - *corner[k];
    if (normal.dot(edge.cross(projected - *corner[k])) < 0.0) return nearest;
  }
  return projected;
}

}  // namespace

Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a, n = ab.cross(ac);
  const double ab_sq = ab.squaredNorm(), ac_sq = ac.squaredNorm(), n_sq = n.squaredNorm();
  if (!(n_sq > kLeastSineSq * ab_sq * ac_sq) || n_sq < kLeastSquare) {
    return closest_on_sliver(p, a, b, c);
  }
  const double along_ab = ab.dot(ap), along_ac = ac.dot(ap);
  if (along_ab <= 0.0 && along_ac <= 0.0) return a;
  // Barycentric coordinates of the corners, times n.n.
  const Eigen::Vector3d turned = ap.cross(n);
  const double of_c = ab.dot(turned), of_b = -ac.dot(turned), of_a = n_sq - of_b - of_c;
  if (of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0) return p - (n.dot(ap) / n_sq) * n;
  // The closest point is on an edge that has p on its outer side.
  Eigen::Vector3d nearest = a;
  double nearest_sq = std::numeric_limits<double>::infinity();
  const auto take_nearer = [&](const Eigen::Vector3d& q) {
    const double q_sq = (q - p).squaredNorm();
    if (!(q_sq < nearest_sq)) return;
    nearest = q;
    nearest_sq = q_sq;
  };
  if (of_c < 0.0) take_nearer(a + std::clamp(along_ab / ab_sq, 0.0, 1.0) * ab);
  if (of_b < 0.0) take_nearer(a + std::clamp(along_ac / ac_sq, 0.0, 1.0) * ac);
  if (of_a < 0.0) take_nearer(closest_on_segment(p, b, c));
  return nearest;
}

}  // namespace ist
