// Support of the part of a TriangleBvh that lies within a sphere.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "internal/geometry/triangle_bvh.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Triangles with less height than this share of their length have no certain plane.
constexpr double kSliver = 1e-6;

// An upper bound of n.(x - center) over the triangle's points x in the sphere: the highest corner,
// or the highest point of the disc that the triangle's plane cuts out of the sphere.
double triangle_support(const TriangleBvh::Triangle& t, const Eigen::Vector3d& center,
                        double radius, const Eigen::Vector3d& n) {
  const Eigen::Vector3d a = t.a - center, b = t.b - center, c = t.c - center;
  const double corners = std::max({n.dot(a), n.dot(b), n.dot(c)});
  const Eigen::Vector3d ab = b - a, ac = c - a, normal = ab.cross(ac);
  const double longest_sq = std::max({ab.squaredNorm(), ac.squaredNorm(), (c - b).squaredNorm()});
  const double area = normal.norm();
  if (!(area > kSliver * longest_sq)) return corners;
  const double plane = normal.dot(a) / area;  // signed distance from the centre
  if (std::abs(plane) > radius) return -kInfinity;
  const double cosine = n.dot(normal) / area;
  const double sine = std::sqrt(std::max(0.0, (1.0 - cosine) * (1.0 + cosine)));
  return std::min(corners, plane * cosine + std::sqrt((radius - plane) * (radius + plane)) * sine);
}

// For each child's box, the squared distance from a point and the support relative to that point.
struct ChildBounds {
  ChildBounds(const TriangleBvh::Boxes& boxes, const Eigen::Vector3d& center,
              const Eigen::Vector3d& n) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double c = center[static_cast<Eigen::Index>(axis)];
      const double along = n[static_cast<Eigen::Index>(axis)];
      const float *low = boxes.min[axis], *high = boxes.max[axis];
      const float* side = along > 0.0 ? high : low;
      for (std::size_t k = 0; k < TriangleBvh::kWidth; ++k) {
        const double gap =
            std::max({static_cast<double>(low[k]) - c, c - static_cast<double>(high[k]), 0.0});
        distance_sq[k] += gap * gap;
        support[k] += along * (static_cast<double>(side[k]) - c);
      }
    }
  }

  std::array<double, TriangleBvh::kWidth> distance_sq{}, support{};
};

}  // namespace

double TriangleBvh::support_in_sphere(const Eigen::Vector3d& center_M, double radius,
                                      const Eigen::Vector3d& n_M, double limit) const {
  double highest = -kInfinity;
  if (triangles_.empty()) return highest;
  const Eigen::Vector3d center = center_M - bounds_.center();
  Stack<std::int32_t> stack;
  stack.push(0);
  while (!stack.empty()) {
    const std::int32_t child = stack.pop();
    if (child < 0) {
      const Leaf& leaf = leaves_[static_cast<std::size_t>(~child)];
      for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k) {
        highest = std::max(highest, triangle_support(triangles_[k], center_M, radius, n_M));
      }
      if (highest > limit) return kInfinity;
      continue;
    }
    const Boxes& boxes = boxes_[static_cast<std::size_t>(child)];
    const ChildBounds bounds(boxes, center, n_M);
    for (std::size_t k = 0; k < static_cast<std::size_t>(boxes.count); ++k) {
      if (bounds.distance_sq[k] <= radius * radius && bounds.support[k] > highest) {
        stack.push(boxes.child[k]);
      }
    }
  }
  return highest;
}

}  // namespace ist
