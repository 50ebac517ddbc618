#include "proximity/carried_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

Eigen::AlignedBox3d box_of(const LinkModel& link) {
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

SeenClouds::Seen SeenClouds::look(const CloudSnapshot& cloud) {
  Seen seen;
  if (!cloud.index.empty()) seen.points = cloud.index.build_id();
  if (cloud.boxes == nullptr || cloud.boxes->empty()) return seen;
  seen.boxes = cloud.boxes->build_id();
  seen.X_FM = cloud.X_FM.matrix().topRows<3>();
  return seen;
}

std::uint64_t SeenClouds::note(SnapshotSpan clouds) {
  bool same = clouds.size() == count_;
  for (std::size_t i = 0; i < clouds.size() && i < seen_.size(); ++i) {
    const Seen now = look(*clouds[i]);
    same = same && now.points == seen_[i].points && now.boxes == seen_[i].boxes &&
           now.X_FM == seen_[i].X_FM;
    seen_[i] = now;
  }
  count_ = clouds.size();
  if (!same) ++number_;
  return clouds.size() > seen_.size() ? 0 : number_;
}

LinkExtent::LinkExtent(const LinkModel& link) {
  const Eigen::AlignedBox3d box = box_of(link);
  center_ = box.center();
  half_ = 0.5 * box.sizes();
  size_ = center_.norm() + half_.norm();
}

double LinkExtent::motion(const Eigen::Isometry3d& X_FA, const Eigen::Isometry3d& X_FB) const {
  const Eigen::Matrix3d turn = X_FB.linear() - X_FA.linear();
  const Eigen::Vector3d middle = turn * center_ + (X_FB.translation() - X_FA.translation());
  const Eigen::Vector3d x = turn.col(0) * half_.x(), y = turn.col(1) * half_.y(),
                        z = turn.col(2) * half_.z();
  double farthest_sq = 0.0;
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const Eigen::Vector3d edge = middle + sx * x + sy * y;
      // |edge + z| or |edge - z|, whichever is larger.
      farthest_sq =
          std::max(farthest_sq, edge.squaredNorm() + z.squaredNorm() + 2.0 * std::abs(edge.dot(z)));
    }
  }
  if (!(middle.squaredNorm() < kInfinity)) return std::numeric_limits<double>::quiet_NaN();
  const double size = X_FA.translation().norm() + X_FB.translation().norm() + size_;
  return farthest_sq > 0.0 ? std::sqrt(farthest_sq) + kLostInLength * size : 0.0;
}

CarriedBound::CarriedBound(const LinkModel& link)
    : extent_(link),
      least_beyond_(!link.solid.is_closed() ? link.tree.interior_gap() : -kInfinity) {}

void CarriedBound::prove(std::uint64_t clouds, const Eigen::Isometry3d& X_FL, double bound,
                         double beyond) {
  clouds_ = bound > 0.0 && beyond > least_beyond_ ? clouds : 0;
  X_FL_ = X_FL;
  bound_ = bound;
  beyond_ = beyond;
}

double CarriedBound::at(std::uint64_t clouds, const Eigen::Isometry3d& X_FL) const {
  if (clouds == 0 || clouds != clouds_) return -kInfinity;
  const double way = extent_.motion(X_FL_, X_FL);
  // Written so that NaN fails.
  if (!(way < bound_ && beyond_ - way > least_beyond_)) return -kInfinity;
  return bound_ - way;
}

double CarriedBound::motion(std::uint64_t clouds, const Eigen::Isometry3d& X_FL) const {
  return clouds == 0 || clouds != clouds_ ? kInfinity : extent_.motion(X_FL_, X_FL);
}

}  // namespace ist
