// The part of TriangleBvh that measures against a box.

#include <algorithm>
#include <array>
#include <cmath>

#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {
namespace {

struct Entry {
  std::int32_t child;
  double gap_sq;
};

double gap_sq(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& low,
              const Eigen::Vector3d& high) {
  return (box.min() - high).cwiseMax(low - box.max()).cwiseMax(0.0).squaredNorm();
}

// A box in the mesh's frame: what it is measured against there is its own bounding box.
struct Seen {
  Seen(const Eigen::AlignedBox3d& box, const Eigen::Isometry3d& X_OM)
      : box_O(box), R_OM(X_OM.linear()), p_OM(X_OM.translation()), abs_R(R_OM.cwiseAbs()) {
    const Eigen::Vector3d center = R_OM.transpose() * (box.center() - p_OM);
    const Eigen::Vector3d half = abs_R.transpose() * (0.5 * box.sizes());
    box_M = Eigen::AlignedBox3d(center - half, center + half);
  }

  // Below the squared distance from the box to anything within [low, high] of the mesh's frame.
  double bound_sq(const Eigen::Vector3d& low, const Eigen::Vector3d& high) const {
    const double in_M = gap_sq(box_M, low, high);
    const Eigen::Vector3d center = R_OM * (0.5 * (low + high)) + p_OM;
    const Eigen::Vector3d half = abs_R * (0.5 * (high - low));
    return std::max(in_M, gap_sq(box_O, center - half, center + half));
  }

  Eigen::AlignedBox3d box_O, box_M;
  Eigen::Matrix3d R_OM;
  Eigen::Vector3d p_OM;
  Eigen::Matrix3d abs_R;
};

}  // namespace

BoxDistance TriangleBvh::closest_to_box(const Eigen::AlignedBox3d& box_O,
                                        const Eigen::Isometry3d& X_OM, double max_distance) const {
  BoxDistance best;
  if (triangles_.empty() || !(max_distance > 0.0)) return best;
  const Seen seen(box_O, X_OM);
  const Eigen::Vector3d origin = bounds_.center();
  double limit_sq = max_distance * max_distance;
  std::array<Entry, 512> stack;
  std::size_t top = 0;
  stack[top++] = {0, 0.0};
  while (top > 0 && best.distance > 0.0) {
    const Entry entry = stack[--top];
    if (entry.gap_sq >= limit_sq) continue;
    if (entry.child < 0) {
      const Leaf& leaf = leaves_[static_cast<std::size_t>(~entry.child)];
      for (std::uint32_t k = 0; k < leaf.count; ++k) {
        const Triangle& triangle = triangles_[leaf.first + k];
        const Eigen::Vector3d a = X_OM * triangle.a, b = X_OM * triangle.b, c = X_OM * triangle.c;
        const Eigen::Vector3d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
        if (gap_sq(box_O, low, high) >= limit_sq) continue;
        const BoxDistance found = triangle_to_box(a, b, c, box_O);
        if (found.distance * found.distance >= limit_sq) continue;
        best = found;
        limit_sq = best.distance * best.distance;
      }
      continue;
    }
    const Boxes& boxes = boxes_[static_cast<std::size_t>(entry.child)];
    const std::size_t begin = top;
    for (int k = 0; k < boxes.count; ++k) {
      const Eigen::Vector3d low(boxes.min[0][k], boxes.min[1][k], boxes.min[2][k]);
      const Eigen::Vector3d high(boxes.max[0][k], boxes.max[1][k], boxes.max[2][k]);
      const double bound_sq = seen.bound_sq(low + origin, high + origin);
      if (bound_sq >= limit_sq) continue;
      std::size_t at = top++;  // nearest on top
      for (; at > begin && stack[at - 1].gap_sq < bound_sq; --at) stack[at] = stack[at - 1];
      stack[at] = {boxes.child[k], bound_sq};
    }
  }
  return best;
}

}  // namespace ist
