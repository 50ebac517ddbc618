#include "internal/geometry/box_distance.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ist {
namespace {

// Triangles with less height than this share of their length count as their edges alone.
constexpr double kNoHeight = 1e-8;

BoxDistance from_point(const Eigen::Vector3d& p, const Eigen::AlignedBox3d& box) {
  BoxDistance result;
  result.p_OS = p;
  result.p_OB = clamp_to(box, p);
  result.distance = result.lower_bound = (result.p_OS - result.p_OB).norm();
  return result;
}

// Half the derivative of the squared distance along a + t d. It grows with t, and is linear between
// the values of t where the segment crosses the plane of a side.
double slope(const Eigen::Vector3d& a, const Eigen::Vector3d& d, double t,
             const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d p = a + t * d;
  return d.dot(p - clamp_to(box, p));
}

bool projects_inside(const Eigen::Vector3d& p, const Eigen::Vector3d& n,
                     const std::array<Eigen::Vector3d, 3>& corner) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d& from = corner[k];
    if (n.dot((corner[(k + 1) % 3] - from).cross(p - from)) < 0.0) return false;
  }
  return true;
}

}  // namespace

BoxDistance segment_to_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                           const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d d = b - a;
  double t0 = 0.0, slope0 = slope(a, d, 0.0, box);
  if (!(slope0 < 0.0)) return from_point(a, box);
  double t1 = 1.0, slope1 = slope(a, d, 1.0, box);
  if (!(slope1 > 0.0)) return from_point(b, box);
  // [t0, t1] shrinks to a piece where the slope is linear and changes its sign.
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {box.min()[axis], box.max()[axis]}) {
      const double t = (side - a[axis]) / d[axis];
      if (!(t > t0 && t < t1)) continue;  // also inf and NaN, if d is 0
      const double s = slope(a, d, t, box);
      (s < 0.0 ? t0 : t1) = t;
      (s < 0.0 ? slope0 : slope1) = s;
    }
  }
  const double t = t0 + (t1 - t0) * std::clamp(-slope0 / (slope1 - slope0), 0.0, 1.0);
  return from_point(a + t * d, box);
}

BoxDistance triangle_to_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c, const Eigen::AlignedBox3d& box) {
  const std::array<Eigen::Vector3d, 3> corner = {a, b, c};
  BoxDistance best;
  double longest_sq = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d &from = corner[k], &to = corner[(k + 1) % 3];
    const BoxDistance edge = segment_to_box(from, to, box);
    if (edge.distance < best.distance) best = edge;
    longest_sq = std::max(longest_sq, (to - from).squaredNorm());
  }
  if (best.distance == 0.0) return best;
  const Eigen::Vector3d n = (b - a).cross(c - a);
  if (!(n.norm() > kNoHeight * longest_sq)) return best;
  // The box's corners farthest against and along the normal.
  const Eigen::Vector3d low = (n.array() > 0.0).select(box.min(), box.max());
  const Eigen::Vector3d high = (n.array() > 0.0).select(box.max(), box.min());
  const double below = n.dot(low - a), above = n.dot(high - a);
  Eigen::Vector3d on_plane, on_box;
  if (below > 0.0 || above < 0.0) {
    on_box = below > 0.0 ? low : high;
    on_plane = on_box - (below > 0.0 ? below : above) / n.squaredNorm() * n;
  } else {
    // The plane's section of the box lies entirely in the triangle or entirely outside it, because
    // no edge of the triangle touches the box.
    on_plane = on_box = low + (below < above ? below / (below - above) : 0.0) * (high - low);
  }
  if (!projects_inside(on_plane, n, corner)) return best;
  const double distance = (on_plane - on_box).norm();
  if (distance < best.distance) best = {distance, distance, on_plane, on_box};
  return best;
}

BoxDistance sphere_to_box(const Sphere& sphere, const Eigen::Vector3d& center_O,
                          const Eigen::AlignedBox3d& box) {
  BoxDistance result = from_point(center_O, box);
  if (result.distance <= sphere.radius) {
    result.p_OS = result.p_OB;
    result.distance = result.lower_bound = 0.0;
    return result;
  }
  result.p_OS = result.p_OB + (1.0 - sphere.radius / result.distance) * (center_O - result.p_OB);
  result.distance = result.lower_bound = (result.p_OS - result.p_OB).norm();
  return result;
}

}  // namespace ist
