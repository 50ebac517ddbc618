#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Flatter than this, a triangle's plane is uncertain: square of height over length.
constexpr double kSliver = 1e-6;

// From the centre to where the triangle's part in the sphere ends: its highest corner, or where the
// disc that its plane cuts out of the sphere is highest, whichever is less.
double reach_within(const TriangleBvh::Triangle& t, const Eigen::Vector3d& center, double radius,
                    const Eigen::Vector3d& n) {
  const Eigen::Vector3d a = t.a - center, b = t.b - center, c = t.c - center;
  const double corners = std::max({n.dot(a), n.dot(b), n.dot(c)});
  const Eigen::Vector3d ab = b - a, ac = c - a, normal = ab.cross(ac);
  const double longest_sq = std::max({ab.squaredNorm(), ac.squaredNorm(), (c - b).squaredNorm()});
  const double area = normal.norm();
  if (!(area > kSliver * longest_sq)) return corners;
  const double off = normal.dot(a) / area;
  if (std::abs(off) > radius) return -kInfinity;
  const double tilt = n.dot(normal) / area;
  const double aside = std::sqrt(std::max(0.0, (1.0 - tilt) * (1.0 + tilt)));
  return std::min(corners, off * tilt + std::sqrt((radius - off) * (radius + off)) * aside);
}

}  // namespace

double TriangleBvh::support_within(const Eigen::Vector3d& center_M, double radius,
                                   const Eigen::Vector3d& n_M, double limit) const {
  double highest = -kInfinity;
  if (triangles_.empty()) return highest;
  const Eigen::Vector3d center = center_M - bounds_.center();
  std::array<std::int32_t, 512> stack;  // as in the search for the closest point
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t child = stack[--top];
    if (child < 0) {
      const Leaf& leaf = leaves_[static_cast<std::size_t>(~child)];
      for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k) {
        highest = std::max(highest, reach_within(triangles_[k], center_M, radius, n_M));
      }
      if (highest > limit) return kInfinity;
      continue;
    }
    const Boxes& boxes = boxes_[static_cast<std::size_t>(child)];
    std::array<double, kWidth> gap_sq{}, reach{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double c = center[static_cast<Eigen::Index>(axis)];
      const double n = n_M[static_cast<Eigen::Index>(axis)];
      const float *low = boxes.min[axis], *high = boxes.max[axis];
      const float* side = n > 0.0 ? high : low;
      for (std::size_t k = 0; k < kWidth; ++k) {
        const double gap =
            std::max({static_cast<double>(low[k]) - c, c - static_cast<double>(high[k]), 0.0});
        gap_sq[k] += gap * gap;
        reach[k] += n * (static_cast<double>(side[k]) - c);
      }
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(boxes.count); ++k) {
      if (gap_sq[k] <= radius * radius && reach[k] > highest) {
        stack[top++] = boxes.child[k];
      }
    }
  }
  return highest;
}

}  // namespace ist
