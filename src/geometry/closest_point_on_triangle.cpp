#include "internal/geometry/closest_point_on_triangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>

namespace ist {
namespace {

// Ericson's method divides by the square of the triangle's area: its error grows with the square of
// length over height. Triangles with less height than this share of their length are slivers.
constexpr double kSliver = 1e-3;
// Triangles with less height than this share of their length have no plane.
constexpr double kNoArea = 1e-8;

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
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double longest_sq = std::max({ab.squaredNorm(), ac.squaredNorm(), (c - b).squaredNorm()});
  if (!(ab.cross(ac).squaredNorm() > kSliver * kSliver * longest_sq * longest_sq)) {
    return closest_on_sliver(p, a, b, c);
  }
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Eigen::Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + (d1 / std::max(d1 - d3, 1e-300)) * ab;
  const Eigen::Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + (d2 / std::max(d2 - d6, 1e-300)) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + ((d4 - d3) / std::max((d4 - d3) + (d5 - d6), 1e-300)) * (c - b);
  }
  const double denominator = 1.0 / (va + vb + vc);
  return a + ab * (vb * denominator) + ac * (vc * denominator);
}

}  // namespace ist
