#include "cloud/filters/view_calibration.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace ist {
namespace {

// The estimate forgets a cloud after about twenty others.
constexpr double kKept = 0.95;
// Patches that a pass needs: fewer of them do not span six degrees of freedom reliably.
constexpr int kFewestPatches = 24;
// Huber's limit, in standard deviations: 95 % as efficient as least squares without outliers.
constexpr double kHuber = 1.345;
// [m] A smaller motion of the points on the robot does not change which rays meet it.
constexpr double kStill = 0.0005;
constexpr int kMostPasses = 5;
// A correction of more standard deviations than this is not one of the stated errors.
constexpr double kDrift = 3.0;

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

}  // namespace

ViewCalibration::ViewCalibration(const ViewFilterConfig& config) : config_(config) {
  const double angle = 1.0 / (config.angle_error * config.angle_error);
  const double position = 1.0 / (config.position_error * config.position_error);
  stated_ << angle, angle, angle, position, position, position;
  information_ = stated_.asDiagonal();
  covariance_ = stated_.cwiseInverse().asDiagonal();
  before_.setZero();
  now_.setZero();
  applied_.setZero();
  middle_.setZero();
  begin_pass();
}

void ViewCalibration::begin_cloud() { passes_ = 0; }

void ViewCalibration::begin_pass() {
  sum_.setZero();
  sum_height_.setZero();
  sum_p_.setZero();
  sum_sq_ = 0.0;
  count_ = 0;
}

void ViewCalibration::add(const Eigen::Vector3d& p_S, const Eigen::Vector3d& n_S, double height,
                          double sigma) {
  // A point that is height + n.(w x p + v) in front of the surface after a twist (w, v) is to be 0.
  Vector6 row;
  row << p_S.cross(n_S), n_S;
  const double expected = std::sqrt(sigma * sigma + row.dot(covariance_ * row));
  const double limit = kHuber * expected;
  const double weight = std::min(1.0, limit / std::max(std::abs(height), 1e-12)) / (sigma * sigma);
  sum_ += weight * row * row.transpose();
  sum_height_ += weight * height * row;
  sum_p_ += p_S;
  sum_sq_ += std::min(height * height, 9.0 * expected * expected);
  ++count_;
}

// Finds the estimate by this pass and what is known beforehand. @returns its information
ViewCalibration::Matrix6 ViewCalibration::solve(Vector6* step) {
  middle_ = sum_p_ / count_;
  residual_ = std::sqrt(sum_sq_ / count_);
  const Matrix6 stated = stated_.asDiagonal();
  const Matrix6 kept = kKept * information_, fresh = (1.0 - kKept) * stated;
  Matrix6 information = kept + fresh + sum_;
  const Vector6 right = -sum_height_ - kept * (applied_ - before_) - fresh * applied_;
  const Eigen::LDLT<Matrix6> solver(information);
  *step = solver.solve(right);
  now_ = applied_ + *step;
  covariance_ = solver.solve(Matrix6::Identity());
  return information;
}

bool ViewCalibration::end_pass() {
  if (std::exchange(uncorrected_count_, 0) > count_) {
    now_.setZero();
    set_correction();
    return true;
  }
  if (count_ < kFewestPatches) return false;
  ++passes_;
  Vector6 step;
  const Matrix6 information = solve(&step);
  set_correction();
  const bool is_last =
      passes_ >= kMostPasses || has_drifted_ || displacement(step, middle_) < kStill;
  if (is_last) {
    has_estimate_ = true;
    before_ = now_;
    information_ = information;
  }
  return !is_last;
}

bool ViewCalibration::end_wide_pass() {
  if (count_ < kFewestPatches) return false;
  Vector6 step;
  solve(&step);
  covariance_ = stated_.cwiseInverse().asDiagonal();
  applied_ = now_;
  apply();
  return true;
}

void ViewCalibration::set_correction() {
  const double moved = displacement(now_, middle_);
  const double allowed = stated_error(middle_.norm());
  // A rotation about the robot moves none of its points, but all that is farther away.
  has_drifted_ = moved > kDrift * allowed || now_.head<3>().norm() > kDrift * config_.angle_error;
  applied_ = has_drifted_ ? Vector6(Vector6::Zero()) : now_;
  apply();
}

void ViewCalibration::apply() {
  X_SC_.setIdentity();
  const double angle = applied_.head<3>().norm();
  if (angle > 0.0) X_SC_.linear() = Eigen::AngleAxisd(angle, applied_.head<3>() / angle).matrix();
  X_SC_.translation() = applied_.tail<3>();
}

double ViewCalibration::displacement(const Vector6& twist, const Eigen::Vector3d& p_S) const {
  return (twist.head<3>().cross(p_S) + twist.tail<3>()).norm();
}

double ViewCalibration::uncertainty(const Eigen::Vector3d& p_S) const {
  if (has_drifted_) return std::numeric_limits<double>::infinity();
  Eigen::Matrix<double, 3, 6> moves;
  moves << -cross_matrix(p_S), Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d covariance = moves * covariance_ * moves.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(solver.eigenvalues()[2], 0.0));
}

void ViewCalibration::report(ViewReport* report) const {
  report->X_SC = X_SC_;
  report->offset = displacement(now_, middle_);
  report->angle = now_.head<3>().norm();
  report->uncertainty = uncertainty(middle_);
  report->residual = residual_;
  report->has_drifted = has_drifted_;
}

}  // namespace ist
