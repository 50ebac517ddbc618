#include "proximity/coherence/displacement.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/float_rounding.h"

namespace ist {

Eigen::AlignedBox3d bounding_box(const LinkModel& link) {
  Eigen::AlignedBox3d box;
  for (const SphereLeaf& leaf : link.tree.leaves()) {
    for (int k = 0; k < leaf.count; ++k) {
      const Eigen::Vector3d center(leaf.x[k], leaf.y[k], leaf.z[k]);
      const double radius = static_cast<double>(leaf.cover_radius[k]) + link.tree.interior_gap();
      box.extend(Eigen::Vector3d(center.array() - radius));
      box.extend(Eigen::Vector3d(center.array() + radius));
    }
  }
  return box.isEmpty() ? Eigen::AlignedBox3d(Eigen::Vector3d::Zero()) : box;
}

DisplacementBound::DisplacementBound(const LinkModel& link)
    : DisplacementBound(bounding_box(link)) {}

DisplacementBound::DisplacementBound(const Eigen::AlignedBox3d& box) {
  center_ = box.center();
  half_ = 0.5 * box.sizes();
  extent_ = center_.norm() + half_.norm();
}

double DisplacementBound::between(const Eigen::Isometry3d& X_FA,
                                  const Eigen::Isometry3d& X_FB) const {
  const Eigen::Matrix3d rotation = X_FB.linear() - X_FA.linear();
  const Eigen::Vector3d center = rotation * center_ + (X_FB.translation() - X_FA.translation());
  const Eigen::Vector3d x = rotation.col(0) * half_.x(), y = rotation.col(1) * half_.y(),
                        z = rotation.col(2) * half_.z();
  double farthest_sq = 0.0;
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const Eigen::Vector3d edge = center + sx * x + sy * y;
      // |edge + z| or |edge - z|, whichever is larger.
      farthest_sq =
          std::max(farthest_sq, edge.squaredNorm() + z.squaredNorm() + 2.0 * std::abs(edge.dot(z)));
    }
  }
  if (!(center.squaredNorm() < std::numeric_limits<double>::infinity())) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double extent = X_FA.translation().norm() + X_FB.translation().norm() + extent_;
  return farthest_sq > 0.0 ? std::sqrt(farthest_sq) + kLostInLength * extent : 0.0;
}

}  // namespace ist
