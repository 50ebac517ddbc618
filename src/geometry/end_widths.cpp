#include <algorithm>
#include <array>
#include <cmath>

#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {
namespace {

struct Corner {
  double depth;           // [m]
  Eigen::Vector3d aside;  // [m] from the line
};

// The part of a triangle down to a depth is convex: its corners are the widest.
double width_to(const std::array<Corner, 3>& corners, double depth) {
  double widest_sq = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Corner &a = corners[k], &b = corners[(k + 1) % 3];
    if (a.depth <= depth) widest_sq = std::max(widest_sq, a.aside.squaredNorm());
    if ((a.depth <= depth) == (b.depth <= depth)) continue;
    const double t = (depth - a.depth) / (b.depth - a.depth);
    widest_sq = std::max(widest_sq, (a.aside + t * (b.aside - a.aside)).squaredNorm());
  }
  return std::sqrt(widest_sq);
}

}  // namespace

bool TriangleBvh::end_widths(const Eigen::Vector3d& n_M, const Eigen::Vector3d& p_M, double highest,
                             const EndDepths& depths, int* budget, EndDepths* widths) const {
  if (triangles_.empty()) return true;
  const Eigen::Vector3d origin = bounds_.center();
  const double lowest = highest - depths.back(), lowest_box = lowest - n_M.dot(origin);
  std::array<std::int32_t, 512> stack;  // as in the search for the closest point
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t child = stack[--top];
    if (child >= 0) {
      const Boxes& boxes = boxes_[static_cast<std::size_t>(child)];
      std::array<double, kWidth> reach{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double n = n_M[static_cast<Eigen::Index>(axis)];
        const float* side = n > 0.0 ? boxes.max[axis] : boxes.min[axis];
        for (std::size_t k = 0; k < kWidth; ++k) reach[k] += n * static_cast<double>(side[k]);
      }
      for (int k = 0; k < boxes.count; ++k) {
        if (reach[static_cast<std::size_t>(k)] >= lowest_box) stack[top++] = boxes.child[k];
      }
      continue;
    }
    const Leaf& leaf = leaves_[static_cast<std::size_t>(~child)];
    *budget -= static_cast<int>(leaf.count);
    if (*budget < 0) return false;
    for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k) {
      const Triangle& t = triangles_[k];
      const Eigen::Vector3d along(n_M.dot(t.a), n_M.dot(t.b), n_M.dot(t.c));
      if (along.maxCoeff() < lowest) continue;
      const auto corner = [&](const Eigen::Vector3d& v, double height) {
        return Corner{highest - height, v - p_M - (height - n_M.dot(p_M)) * n_M};
      };
      const std::array<Corner, 3> corners = {corner(t.a, along[0]), corner(t.b, along[1]),
                                             corner(t.c, along[2])};
      for (std::size_t i = 0; i < depths.size(); ++i) {
        (*widths)[i] = std::max((*widths)[i], width_to(corners, depths[i]));
      }
    }
  }
  return true;
}

}  // namespace ist
