// The closest pair of points of a TriangleBvh and a solid box.

#include <algorithm>
#include <cmath>

#include "internal/geometry/triangle_bvh.h"

namespace ist {
namespace {

double distance_sq(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& low,
                   const Eigen::Vector3d& high) {
  return (box.min() - high).cwiseMax(low - box.max()).cwiseMax(0.0).squaredNorm();
}

// A box that is axis-aligned in frame O, and its bounding box in the frame M of a mesh.
class PosedBox {
 public:
  PosedBox(const Eigen::AlignedBox3d& box, const Eigen::Isometry3d& X_OM)
      : box_O_(box), R_OM_(X_OM.linear()), p_OM_(X_OM.translation()), abs_R_OM_(R_OM_.cwiseAbs()) {
    const Eigen::Vector3d center = R_OM_.transpose() * (box.center() - p_OM_);
    const Eigen::Vector3d half = abs_R_OM_.transpose() * (0.5 * box.sizes());
    box_M_ = Eigen::AlignedBox3d(center - half, center + half);
  }

  // A lower bound of the squared distance from the box to the box [low, high] in frame M.
  double lower_bound_sq(const Eigen::Vector3d& low, const Eigen::Vector3d& high) const {
    const double in_M = distance_sq(box_M_, low, high);
    const Eigen::Vector3d center = R_OM_ * (0.5 * (low + high)) + p_OM_;
    const Eigen::Vector3d half = abs_R_OM_ * (0.5 * (high - low));
    return std::max(in_M, distance_sq(box_O_, center - half, center + half));
  }

 private:
  Eigen::AlignedBox3d box_O_, box_M_;
  Eigen::Matrix3d R_OM_;
  Eigen::Vector3d p_OM_;
  Eigen::Matrix3d abs_R_OM_;
};

// Keeps the closest pair of a triangle and the box, and its squared distance as an upper bound.
void visit_triangle(const TriangleBvh::Triangle& triangle, const Eigen::AlignedBox3d& box_O,
                    const Eigen::Isometry3d& X_OM, double* upper_bound_sq, BoxDistance* best) {
  const Eigen::Vector3d a = X_OM * triangle.a, b = X_OM * triangle.b, c = X_OM * triangle.c;
  const Eigen::Vector3d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
  if (distance_sq(box_O, low, high) >= *upper_bound_sq) return;
  const BoxDistance found = triangle_to_box(a, b, c, box_O);
  if (found.distance * found.distance >= *upper_bound_sq) return;
  *best = found;
  *upper_bound_sq = best->distance * best->distance;
}

}  // namespace

BoxDistance TriangleBvh::closest_to_box(const Eigen::AlignedBox3d& box_O,
                                        const Eigen::Isometry3d& X_OM, double max_distance) const {
  BoxDistance best;
  if (triangles_.empty() || !(max_distance > 0.0)) return best;
  const PosedBox posed_box(box_O, X_OM);
  const Eigen::Vector3d origin = bounds_.center();
  double upper_bound_sq = max_distance * max_distance;
  struct Entry {
    std::int32_t child;
    double lower_bound_sq;
  };
  Stack<Entry> stack;
  stack.push({0, 0.0});
  while (!stack.empty() && best.distance > 0.0) {
    const Entry entry = stack.pop();
    if (entry.lower_bound_sq >= upper_bound_sq) continue;
    if (entry.child < 0) {
      const Leaf& leaf = leaves_[static_cast<std::size_t>(~entry.child)];
      for (std::uint32_t k = 0; k < leaf.count; ++k) {
        visit_triangle(triangle(leaf.first + k), box_O, X_OM, &upper_bound_sq, &best);
      }
      continue;
    }
    const Boxes& boxes = boxes_[static_cast<std::size_t>(entry.child)];
    const std::size_t first = stack.size();
    for (int k = 0; k < boxes.count; ++k) {
      const Eigen::Vector3d low(boxes.min[0][k], boxes.min[1][k], boxes.min[2][k]);
      const Eigen::Vector3d high(boxes.max[0][k], boxes.max[1][k], boxes.max[2][k]);
      const double lower_bound_sq = posed_box.lower_bound_sq(low + origin, high + origin);
      if (lower_bound_sq >= upper_bound_sq) continue;
      stack.push_least_on_top<&Entry::lower_bound_sq>(first, {boxes.child[k], lower_bound_sq});
    }
  }
  return best;
}

}  // namespace ist
