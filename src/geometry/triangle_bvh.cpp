#include "ist_proximity/geometry/triangle_bvh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/triangle_bvh_builder.h"
#include "geometry/triangle_kernels.h"

namespace ist {
namespace {

// The winding number's expansion is used where the point is at least beta radii away.
constexpr float kQuickBeta = 2.0F;
constexpr float kBeta = 6.0F;

// The usual closest point divides by the square of the triangle's area: what it loses grows with
// the square of length over height. Flatter than this, another way is taken.
constexpr double kSliver = 1e-3;
constexpr double kNoArea = 1e-8;

Eigen::Vector3d closest_on_segment(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b) {
  const Eigen::Vector3d ab = b - a;
  const double length_sq = ab.squaredNorm();
  if (!(length_sq > 0.0)) return a;
  return a + std::clamp((p - a).dot(ab) / length_sq, 0.0, 1.0) * ab;
}

// The nearest point of the edges, or from there within the plane where that comes nearer: by no
// more than the triangle's height.
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
  // From the two shorter edges the normal is the least uncertain.
  const Eigen::Vector3d& apex = *corner[longest + 2];
  const Eigen::Vector3d n = (*corner[longest] - apex).cross(*corner[longest + 1] - apex);
  const double area = n.norm();
  if (!(area > kNoArea * longest_sq)) return nearest;
  const Eigen::Vector3d normal = n / area, off = p - nearest;
  const Eigen::Vector3d projected = p - normal.dot(off) * normal;
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

TriangleBvh::TriangleBvh(const TriangleMesh& mesh) { TriangleBvhBuilder(mesh, this).run(); }

TriangleBvh::View TriangleBvh::view() const {
  return {boxes_.data(),
          slabs_.data(),
          moments_.data(),
          leaves_.data(),
          triangles_.data(),
          bounds_.center(),
          0.5 * bounds_.sizes().norm()};
}

ClosestPoint TriangleBvh::closest(const Eigen::Vector3d& p_M, double max_distance_sq,
                                  const Eigen::Vector3d& toward_M, double enough_sq,
                                  double slack) const {
  ClosestPoint closest;
  closest.lower_bound = std::sqrt(max_distance_sq);
  if (!triangles_.empty()) {
    find_closest(view(), p_M, max_distance_sq, toward_M, enough_sq, slack, &closest);
  }
  return closest;
}

double TriangleBvh::support(const Eigen::Vector3d& n_M, double slack, double reached) const {
  return triangles_.empty() ? reached : find_farthest(view(), n_M, slack, reached);
}

double TriangleBvh::winding_number(const Eigen::Vector3d& p_M) const {
  return triangles_.empty() ? 0.0 : sum_winding(view(), p_M, kBeta);
}

double TriangleBvh::quick_winding_number(const Eigen::Vector3d& p_M) const {
  return triangles_.empty() ? 0.0 : sum_winding(view(), p_M, kQuickBeta);
}

bool TriangleBvh::is_inside(const Eigen::Vector3d& p_M) const {
  const double w = quick_winding_number(p_M);
  if (std::abs(w - 0.5) > kQuickWindingError) return w > 0.5;
  return winding_number(p_M) > 0.5;
}

}  // namespace ist
