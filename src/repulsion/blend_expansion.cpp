#include "repulsion/blend_expansion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "internal/bvh/box_node.h"

namespace ist {
namespace {

// The slopes of neighbours that are taken for one point may be off by this share.
constexpr float kSlopeError = 0.2F;

using BySphereMap = Eigen::Map<const Eigen::Array<float, static_cast<int>(kCoarseSpheres), 1>>;

}  // namespace

BlendExpansion::Vectors BlendExpansion::times(const Eigen::Matrix3f& A, const Vectors& v) const {
  Vectors result;
  result.x = A(0, 0) * v.x + A(0, 1) * v.y + A(0, 2) * v.z;
  result.y = A(1, 0) * v.x + A(1, 1) * v.y + A(1, 2) * v.z;
  result.z = A(2, 0) * v.x + A(2, 1) * v.y + A(2, 2) * v.z;
  return result;
}

void BlendExpansion::begin(const std::vector<SphereGroup>& groups, const Eigen::Isometry3d& X_FL) {
  constexpr auto kWidth = static_cast<std::size_t>(kSphereGroupWidth);
  *this = BlendExpansion();
  X_FL_ = X_FL;
  has_slopes_ = true;
  distance_.setConstant(kFarAway);
  for (std::size_t i = 0; i < kCoarseSpheres && !groups.empty(); ++i) {
    const std::size_t g = i / kWidth, k = i % kWidth;
    const bool is_used = g < groups.size() && groups[g].x[k] < kFarAway;
    const SphereGroup& group = groups[is_used ? g : 0];
    const std::size_t slot = is_used ? k : 0;
    const auto row = static_cast<Eigen::Index>(i);
    p_LC_.x[row] = group.x[slot];
    p_LC_.y[row] = group.y[slot];
    p_LC_.z[row] = group.z[slot];
  }
}

void BlendExpansion::add(const NearestPoints& points, const Eigen::Matrix3d& R_FO) {
  const Vectors offset = {BySphereMap(points.offset[0]), BySphereMap(points.offset[1]),
                          BySphereMap(points.offset[2])};
  const Vectors turned = times(R_FO.cast<float>(), offset);
  for (Eigen::Index i = 0; i < distance_.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!(points.distance[k] < distance_[i])) continue;
    const float length = std::hypot(turned.x[i], turned.y[i], turned.z[i]);
    const float scale = length > 0.0F ? 1.0F / length : 0.0F;
    distance_[i] = points.distance[k];
    toward_.x[i] = scale * turned.x[i];
    toward_.y[i] = scale * turned.y[i];
    toward_.z[i] = scale * turned.z[i];
  }
}

void BlendExpansion::add(const SphereSums& sums, const Eigen::Matrix3d& R_FO, bool has_slopes) {
  const Eigen::Matrix3f R = R_FO.cast<float>();
  const auto vectors = [](const BySphere v[3]) {
    return Vectors{BySphereMap(v[0]), BySphereMap(v[1]), BySphereMap(v[2])};
  };
  const auto accumulate = [](const Vectors& v, Vectors* sum) {
    sum->x += v.x;
    sum->y += v.y;
    sum->z += v.z;
  };
  accumulate(times(R, vectors(sums.force)), &force_);
  accumulate(times(R, vectors(sums.slope)), &slope_);
  weight_ += BySphereMap(sums.weight);
  per_length_ += BySphereMap(sums.per_length);
  weight_slope_ += BySphereMap(sums.weight_slope);
  has_slopes_ = has_slopes_ && has_slopes;
  // R S R^T: the columns of S, then the rows of the product.
  const BySphereMap xx(sums.outer[0]), yy(sums.outer[1]), zz(sums.outer[2]), xy(sums.outer[3]),
      yz(sums.outer[4]), zx(sums.outer[5]);
  const Vectors a = times(R, {xx, xy, zx}), b = times(R, {xy, yy, yz}), c = times(R, {zx, yz, zz});
  const Vectors x = times(R, {a.x, b.x, c.x}), y = times(R, {a.y, b.y, c.y}),
                z = times(R, {a.z, b.z, c.z});
  accumulate({x.x, y.y, z.z}, &outer_);
  accumulate({x.y, y.z, z.x}, &outer_mixed_);
}

void BlendExpansion::end(const Sums& sums, double nearest) {
  sums_ = sums;
  nearest_ = static_cast<float>(nearest);
}

// [m] The error of the sums as if nothing was expanded and the spheres had moved by this, averaged
// with their weights. To second order in the motion m, a direction to a point at h errs by (m /
// h)^2 where without an expansion it errs by m / h.
double BlendExpansion::remaining_error(const Slots& moved) const {
  const float weight = weight_.sum();
  const Slots error = has_slopes_
                          ? Slots(kSlopeError * weight_ * moved + per_length_ * moved.square())
                          : Slots(weight_ * moved);
  return static_cast<double>(error.sum() / weight);
}

// [m] How much nearer or farther the nearest pair is. Each sphere may have become the nearest one.
float BlendExpansion::change_of_nearest(const Vectors& moved) const {
  const Slots distance =
      distance_ + toward_.x * moved.x + toward_.y * moved.y + toward_.z * moved.z;
  return distance.minCoeff() - nearest_;
}

bool BlendExpansion::find(const Eigen::Isometry3d& X_FL, double error, double farthest,
                          Sums* sums) const {
  const Eigen::Matrix<float, 3, 4> D =  // from a point of the link to its displacement
      (X_FL.matrix() - X_FL_.matrix()).topRows<3>().cast<float>();
  const Vectors turned = times(D.leftCols<3>(), p_LC_);  // of the arms from the link's origin
  const Vectors moved = {turned.x + D(0, 3), turned.y + D(1, 3), turned.z + D(2, 3)};
  const Slots length = (moved.x.square() + moved.y.square() + moved.z.square()).sqrt();
  // Written so that NaN is too far.
  if (!(static_cast<double>(length.maxCoeff()) <= farthest)) return false;
  if (!(remaining_error(length) <= error)) return false;
  *sums = sums_;
  if (!has_slopes_) return true;
  const float nearer = change_of_nearest(moved);
  const Vectors force = {per_length_ * moved.x + outer_.x * moved.x + outer_mixed_.x * moved.y +
                             outer_mixed_.z * moved.z - slope_.x * nearer,
                         per_length_ * moved.y + outer_mixed_.x * moved.x + outer_.y * moved.y +
                             outer_mixed_.y * moved.z - slope_.y * nearer,
                         per_length_ * moved.z + outer_mixed_.z * moved.x +
                             outer_mixed_.y * moved.y + outer_.z * moved.z - slope_.z * nearer};
  const Slots weight =
      slope_.x * moved.x + slope_.y * moved.y + slope_.z * moved.z - weight_slope_ * nearer;
  const Vectors arm = times(X_FL.linear().cast<float>(), p_LC_);
  const Eigen::Vector3f torque(
      (arm.y * force.z - arm.z * force.y + turned.y * force_.z - turned.z * force_.y).sum(),
      (arm.z * force.x - arm.x * force.z + turned.z * force_.x - turned.x * force_.z).sum(),
      (arm.x * force.y - arm.y * force.x + turned.x * force_.y - turned.y * force_.x).sum());
  sums->wrench.force += Eigen::Vector3f(force.x.sum(), force.y.sum(), force.z.sum()).cast<double>();
  sums->wrench.torque += torque.cast<double>();
  sums->weight += static_cast<double>(weight.sum());
  return sums->weight > 0.0;
}

}  // namespace ist
