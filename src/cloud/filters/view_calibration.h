#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "ist_proximity/cloud/view_filter.h"

namespace ist {

/// Estimates by how much a sensor's pose is wrong, from the points that it measures on the robot:
/// the rigid motion that takes them to the robot's surface, by least squares of their distances
/// along its normals, with Huber's weights.
///
/// The estimate is a recursive one with exponential forgetting toward the errors that are stated
/// beforehand (Ljung 1999, section 11.2): a direction in which nothing is seen returns to them.
class ViewCalibration {
 public:
  explicit ViewCalibration(const ViewFilterConfig& config);

  /// Begins a cloud, or another look at the same one with the correction found so far.
  void begin_cloud();
  void begin_pass();

  /// Adds a patch of the robot's surface.
  /// @param p_S    [m] middle of its measured points, as measured
  /// @param n_S    outward unit normal of the surface
  /// @param height    [m] mean distance of the points in front of the surface
  /// @param sigma  [m] > 0: its standard deviation
  void add(const Eigen::Vector3d& p_S, const Eigen::Vector3d& n_S, double height, double sigma);

  /// Ends a pass. @returns whether the points moved so far that another pass is worthwhile
  bool end_pass();

  /// Whether a cloud has shown enough of the robot.
  bool has_estimate() const { return has_estimate_; }
  /// Ends a pass that only counts the patches which are found without any correction.
  void end_count() { uncorrected_count_ = count_; }
  /// Ends a pass of the first cloud that has looked farther than the padding. Its points need not
  /// be the robot's: what it finds is where the next pass begins, no estimate. Where that begins
  /// with fewer patches than without any correction, it begins without one.
  /// @returns false: there were too few patches
  bool end_wide_pass();

  /// Corrected sensor frame: X_FS X_SC takes measured points to the fixed frame.
  const Eigen::Isometry3d& X_SC() const { return X_SC_; }
  /// [m] Standard deviation of a point at a distance [m], as stated beforehand.
  double stated_error(double distance) const {
    return std::hypot(config_.position_error, config_.angle_error * distance);
  }
  /// [m] Standard deviation of a corrected point along its worst direction.
  double uncertainty(const Eigen::Vector3d& p_S) const;
  /// Fills the members about the sensor's pose.
  void report(ViewReport* report) const;

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  Matrix6 solve(Vector6* step);
  void set_correction();
  void apply();
  double displacement(const Vector6& twist, const Eigen::Vector3d& p_S) const;

  ViewFilterConfig config_;
  Vector6 stated_;          // diagonal of the information that is stated beforehand
  Matrix6 information_;     // of the estimate before this cloud
  Vector6 before_, now_;    // estimates: rotation vector [rad] and translation [m]
  Vector6 applied_;         // what the points of this pass are corrected by
  Matrix6 covariance_;      // of `now_`
  Matrix6 sum_;             // of this pass: normal matrix
  Vector6 sum_height_;      // of this pass: right-hand side
  Eigen::Vector3d sum_p_;   // of this pass [m]
  Eigen::Vector3d middle_;  // [m] of the points on the robot
  double sum_sq_ = 0.0, residual_ = 0.0;
  int count_ = 0, passes_ = 0, uncorrected_count_ = 0;
  bool has_drifted_ = false, has_estimate_ = false;
  Eigen::Isometry3d X_SC_ = Eigen::Isometry3d::Identity();
};

}  // namespace ist
