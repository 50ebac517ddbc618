#include "control/nearest_velocity.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/numbers.h"

namespace ist {
namespace {

constexpr double kViolation = 1e-10;  // that counts, relative to the velocity or to 1
// Normals nearer to the span of the active ones than this, as a sine, depend on them.
constexpr double kDependent = 1e-8;
constexpr int kMaxIterations = 300;

}  // namespace

NearestVelocity::NearestVelocity(Eigen::Index joints)
    : scale_(joints),
      x_(joints),
      speed_(joints),
      y_(joints),
      N_(joints, joints),
      Q_(joints, joints),
      R_(joints, joints),
      multipliers_(joints),
      normal_(joints),
      step_(joints),
      along_(joints),
      rates_(joints) {
  active_.reserve(static_cast<std::size_t>(joints) + 1);
}

NearestVelocity::Outcome NearestVelocity::solve(
    const ConstraintRows& rows, const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
    const Eigen::VectorXd& weights, const Eigen::VectorXd& target,
    std::chrono::steady_clock::time_point end, Eigen::VectorXd* x) {
  rows_ = &rows;
  lower_ = &lower;
  upper_ = &upper;
  scale_ = weights.cwiseSqrt();
  x_ = target;
  y_ = scale_.cwiseProduct(x_);
  active_.clear();
  count_ = 0;
  for (iterations_ = 0; iterations_ < kMaxIterations; ++iterations_) {
    speed_ = x_.cwiseAbs();
    const Bound worst = most_violated();
    if (worst.violation <= kViolation * std::max(1.0, y_.lpNorm<Eigen::Infinity>())) {
      *x = x_;
      return Outcome::kFound;
    }
    if (iterations_ > 0 && std::chrono::steady_clock::now() >= end) return Outcome::kOutOfTime;
    take_normal(worst.what);
    if (!take_in(worst.what)) {
      active_.push_back(worst.what);
      return Outcome::kContradiction;
    }
  }
  return Outcome::kOutOfTime;
}

NearestVelocity::Bound NearestVelocity::most_violated() const {
  using Kind = ActiveBound::Kind;
  Bound worst{{Kind::kUpper, 0}, 0.0};
  const auto consider = [&worst](Kind kind, Eigen::Index index, double violation) {
    if (violation > worst.violation) worst = {{kind, index}, violation};
  };
  for (Eigen::Index k = 0; k < x_.size(); ++k) {
    consider(Kind::kUpper, k, scale_[k] * (x_[k] - (*upper_)[k]));
    consider(Kind::kLower, k, scale_[k] * ((*lower_)[k] - x_[k]));
  }
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(rows_->count); ++i) {
    const double approach = rows_->G.row(i).dot(x_.transpose()) - rows_->h[i];
    const double sweep = rows_->sweep.row(i).dot(speed_.transpose()) - rows_->sweep_limit[i];
    if (approach > 0.0) consider(Kind::kApproach, i, approach / scaled_norm(rows_->G, i));
    if (sweep > 0.0) consider(Kind::kSweep, i, sweep / scaled_norm(rows_->sweep, i));
  }
  return worst;
}

// The length of a row's normal in the scaled space.
double NearestVelocity::scaled_norm(const ConstraintRows::Matrix& rows, Eigen::Index row) const {
  double norm_sq = 0.0;
  for (Eigen::Index k = 0; k < x_.size(); ++k) {
    norm_sq += (rows(row, k) / scale_[k]) * (rows(row, k) / scale_[k]);
  }
  return std::sqrt(norm_sq);
}

// Sets normal_, of unit length, and limit_.
void NearestVelocity::take_normal(const ActiveBound& bound) {
  const Eigen::Index i = bound.index;
  normal_.setZero();
  switch (bound.kind) {
    case ActiveBound::Kind::kUpper:
      normal_[i] = 1.0;
      limit_ = scale_[i] * (*upper_)[i];
      return;
    case ActiveBound::Kind::kLower:
      normal_[i] = -1.0;
      limit_ = -scale_[i] * (*lower_)[i];
      return;
    case ActiveBound::Kind::kApproach:
      normal_ = rows_->G.row(i).transpose().cwiseQuotient(scale_);
      limit_ = rows_->h[i];
      break;
    case ActiveBound::Kind::kSweep:
      for (Eigen::Index k = 0; k < x_.size(); ++k) {
        normal_[k] = std::copysign(rows_->sweep(i, k), x_[k]) / scale_[k];
      }
      limit_ = rows_->sweep_limit[i];
      break;
  }
  const double norm = normal_.norm();
  if (!(norm > 0.0)) return;
  normal_ /= norm;
  limit_ /= norm;
}

// Makes the bound of normal_ active, with steps in the dual and the primal space. Returns false
// where it contradicts the active ones.
bool NearestVelocity::take_in(const ActiveBound& bound) {
  double multiplier = 0.0;
  for (;; ++iterations_) {
    if (iterations_ >= kMaxIterations) return true;  // solve() ends
    // step_: what is left of the normal; rates_: by how much active multipliers fall.
    auto active_Q = Q_.leftCols(count_);
    along_.head(count_).noalias() = active_Q.transpose() * normal_;
    step_ = normal_;
    step_.noalias() -= active_Q * along_.head(count_);
    rates_.head(count_) = along_.head(count_);
    if (count_ > 0) {
      auto rates = rates_.head(count_);
      R_.topLeftCorner(count_, count_).triangularView<Eigen::Upper>().solveInPlace(rates);
    }
    const double left_sq = step_.squaredNorm();
    double dual = kInfinity;
    Eigen::Index dropped = -1;
    for (Eigen::Index j = 0; j < count_; ++j) {
      if (rates_[j] > kDependent && multipliers_[j] / rates_[j] < dual) {
        dual = multipliers_[j] / rates_[j];
        dropped = j;
      }
    }
    const bool is_free = left_sq > kDependent * kDependent && count_ < x_.size();
    const double primal = is_free ? std::max(normal_.dot(y_) - limit_, 0.0) / left_sq : kInfinity;
    const double length = std::min(dual, primal);
    if (length == kInfinity) return false;
    multiplier += length;
    multipliers_.head(count_) -= length * rates_.head(count_);
    if (is_free) {
      y_ -= length * step_;
      x_ = y_.cwiseQuotient(scale_);
    }
    if (primal <= dual) {
      push(bound, multiplier);
      return true;
    }
    drop(dropped);
  }
}

void NearestVelocity::push(const ActiveBound& bound, double multiplier) {
  N_.col(count_) = normal_;
  multipliers_[count_] = multiplier;
  active_.push_back(bound);
  orthonormalize(count_++);
}

void NearestVelocity::drop(Eigen::Index position) {
  --count_;
  active_.erase(active_.begin() + position);
  for (Eigen::Index j = position; j < count_; ++j) {
    N_.col(j) = N_.col(j + 1);
    multipliers_[j] = multipliers_[j + 1];
  }
  for (Eigen::Index j = position; j < count_; ++j) orthonormalize(j);
}

// A column of Q and R, by the ones before it: Gram and Schmidt, twice.
void NearestVelocity::orthonormalize(Eigen::Index position) {
  auto q = Q_.col(position);
  auto r = R_.col(position);
  q = N_.col(position);
  r.setZero();
  for (int pass = 0; pass < 2; ++pass) {
    for (Eigen::Index j = 0; j < position; ++j) {
      const double along = Q_.col(j).dot(q);
      q -= along * Q_.col(j);
      r[j] += along;
    }
  }
  r[position] = q.norm();
  q /= r[position];
}

}  // namespace ist
