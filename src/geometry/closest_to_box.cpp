// The closest pair of points of a TriangleBvh and a solid box.

#include <algorithm>
#include <cmath>

#include "geometry/posed_box_kernel.h"
#include "internal/geometry/triangle_bvh.h"

namespace ist {
namespace {

// Bounds in float are too large by less than this share of all lengths involved.
constexpr double kFloatRounding = 4e-6;
// A triangle may be nearer than the one that is found by this share of the distance. Neighbours
// of the closest triangle have the same closest point, to rounding.
constexpr double kSame = 1e-12;
// [m] A way that is shorter has no direction.
constexpr double kLeastWay = 1e-9;

double distance_sq(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& low,
                   const Eigen::Vector3d& high) {
  return (box.min() - high).cwiseMax(low - box.max()).cwiseMax(0.0).squaredNorm();
}

// The search for the triangle that is closest to a box.
class BoxSearch {
 public:
  /// @param X_OM    the mesh's frame M -> O
  /// @param origin  centre of the mesh's bounding box
  /// @param radius  half its diagonal
  BoxSearch(const Eigen::AlignedBox3d& box_O, const Eigen::Isometry3d& X_OM, double max_distance,
            const Eigen::Vector3d& origin, double radius)
      : box_O_(box_O), X_OM_(X_OM), upper_bound_(max_distance) {
    const Eigen::Matrix3d R_MO = X_OM.linear().transpose();
    const Eigen::Vector3d center_M = R_MO * (box_O.center() - X_OM.translation()) - origin;
    const Eigen::Vector3d half_O = 0.5 * box_O.sizes(), half_M = R_MO.cwiseAbs() * half_O;
    for (int i = 0; i < 3; ++i) {
      posed_.center_M[i] = static_cast<float>(center_M[i]);
      posed_.half_O[i] = static_cast<float>(half_O[i]);
      posed_.half_M[i] = static_cast<float>(half_M[i]);
      for (int j = 0; j < 3; ++j) posed_.rotation[i][j] = static_cast<float>(R_MO(j, i));
    }
    // The poses of a mesh and of a box are rounded as well.
    const double far = origin.norm() + X_OM.translation().norm() + box_O.center().norm();
    posed_.slack = static_cast<float>(kFloatRounding *
                                      (center_M.norm() + radius + half_O.norm() + 1e-6 * far));
  }

  const PosedBox& posed() const { return posed_; }
  double upper_bound() const { return upper_bound_; }
  const BoxDistance& best() const { return best_; }

  // Takes a place that the mesh's closest point may be near. The box is behind the plane across the
  // way from there, so that bounds hold wherever the place is.
  void expect_near(const Eigen::Vector3d& p_O) {
    const Eigen::Vector3d p_OB = clamp_to(box_O_, p_O);
    const double distance = (p_OB - p_O).norm();
    if (distance > kLeastWay) separate((p_OB - p_O) / distance, p_OB);
  }

  void visit(const TriangleBvh::Triangle& triangle) {
    const double nearest =
        std::max({normal_M_.dot(triangle.a), normal_M_.dot(triangle.b), normal_M_.dot(triangle.c)});
    if (offset_M_ - nearest >= (1.0 - kSame) * upper_bound_) return;
    const Eigen::Vector3d a = X_OM_ * triangle.a, b = X_OM_ * triangle.b, c = X_OM_ * triangle.c;
    const Eigen::Vector3d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
    if (distance_sq(box_O_, low, high) >= upper_bound_ * upper_bound_) return;
    const BoxDistance found = triangle_to_box(a, b, c, box_O_);
    if (found.distance >= upper_bound_) return;
    best_ = found;
    best_.lower_bound = (1.0 - 2.0 * kSame) * found.distance;
    upper_bound_ = found.distance;
    if (upper_bound_ > 0.0) separate((best_.p_OB - best_.p_OS) / best_.distance, best_.p_OB);
  }

 private:
  // The plane through the box's closest point to some other point, across the way from there, has
  // the whole box behind it.
  void separate(const Eigen::Vector3d& normal_O, const Eigen::Vector3d& p_OB) {
    normal_M_ = X_OM_.linear().transpose() * normal_O;
    offset_M_ = normal_O.dot(p_OB - X_OM_.translation());
    for (int i = 0; i < 3; ++i) posed_.normal_M[i] = static_cast<float>(normal_M_[i]);
    posed_.offset = static_cast<float>(normal_O.dot(p_OB - box_O_.center()));
  }

  const Eigen::AlignedBox3d& box_O_;
  const Eigen::Isometry3d& X_OM_;
  PosedBox posed_;
  double upper_bound_;
  BoxDistance best_;
  Eigen::Vector3d normal_M_ = Eigen::Vector3d::Zero();
  double offset_M_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

BoxDistance TriangleBvh::closest_to_box(const Eigen::AlignedBox3d& box_O,
                                        const Eigen::Isometry3d& X_OM, double max_distance,
                                        const std::optional<Eigen::Vector3d>& near_O) const {
  if (triangles_.empty() || !(max_distance > 0.0)) return {};
  BoxSearch search(box_O, X_OM, max_distance, bounds_.center(), 0.5 * bounds_.diagonal().norm());
  if (near_O) search.expect_near(*near_O);
  struct Entry {
    std::int32_t child;
    float lower_bound;
  };
  Stack<Entry> stack;
  stack.push({0, 0.0F});
  alignas(32) float bounds[kWidth];
  while (!stack.empty() && search.best().distance > 0.0) {
    const Entry entry = stack.pop();
    if (static_cast<double>(entry.lower_bound) >= search.upper_bound()) continue;
    if (entry.child < 0) {
      const Leaf& leaf = leaves_[static_cast<std::size_t>(~entry.child)];
      for (std::uint32_t k = 0; k < leaf.count; ++k) search.visit(triangles_[leaf.first + k]);
      continue;
    }
    const Boxes& boxes = boxes_[static_cast<std::size_t>(entry.child)];
    posed_box_bounds(boxes, search.posed(), bounds);
    const std::size_t first = stack.size();
    for (int k = 0; k < boxes.count; ++k) {
      if (static_cast<double>(bounds[k]) >= search.upper_bound()) continue;
      stack.push_least_on_top<&Entry::lower_bound>(first, {boxes.child[k], bounds[k]});
    }
  }
  return search.best();
}

}  // namespace ist
