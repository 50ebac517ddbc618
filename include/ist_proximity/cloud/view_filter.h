#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <vector>

namespace ist {

/// How the self-filter decides which points are the robot's.
enum class SelfFilterMode : std::uint8_t {
  kPadding,  ///< whatever is within the padding of a link
  /// The ones of these that agree with where the sensor must see the robot, and single pixels that
  /// noise has put in front of it (doc/sources.md).
  /// Points that do not lie on rays from the sensor frame's origin, and clouds that are no image,
  /// are filtered by padding.
  kView,
};

/// The standard deviation of a measured range [m]: constant + quadratic range^2.
struct RangeNoise {
  double constant = 0.003;   ///< [m] >= 0
  double quadratic = 0.002;  ///< [1/m] >= 0

  /// [m] Standard deviation at a range [m].
  double sigma(double range) const { return constant + quadratic * range * range; }
};

/// The errors of what the view of the robot is compared with.
struct ViewFilterConfig {
  RangeNoise noise;  ///< of each pixel, independent of its neighbours
  /// [m] and [rad]: standard deviations of the sensor's pose as tf gives it. The correction that is
  /// estimated from the points on the robot begins with them.
  double position_error = 0.005;  ///< [m] > 0
  double angle_error = 0.0175;    ///< [rad] > 0
  double model_error = 0.002;     ///< [m] >= 0: of the links' shapes and of the joints
  double time_error = 0.003;      ///< [s] >= 0: of the cloud's stamp against that of the poses
  double mixed_pixels = 1.0;      ///< [pixels] >= 0: an edge of the robot is blurred by as much
};

/// The view of one link.
struct LinkView {
  std::uint32_t solid = 0;  ///< its number in the robot that Ingest was given
  /// [m] An obstacle of four by four pixels whose visible side is nearer to the link's than this
  /// may be taken for the link. The padding where the sensor's pose is not known well enough.
  double blind_skin = std::numeric_limits<double>::quiet_NaN();
  std::uint32_t in_skin = 0;      ///< points within the padding of the link
  std::uint32_t unexplained = 0;  ///< of these, points that the link does not explain: obstacles
};

/// The findings of a self-filter by view in one cloud.
struct ViewReport {
  bool is_used = false;  ///< false: the cloud was filtered by padding
  /// The sensor's pose is corrected by this, as estimated from the points on the robot: X_FS as
  /// given, times this, is where the sensor is taken to be.
  Eigen::Isometry3d X_SC = Eigen::Isometry3d::Identity();
  double offset = 0.0;       ///< [m] by which the correction moves the points on the robot
  double angle = 0.0;        ///< [rad] of the correction
  double uncertainty = 0.0;  ///< [m] standard deviation of the corrected points on the robot
  double residual = 0.0;     ///< [m] root mean square, across the surface, that remains
  /// Whether the correction is more than three times what position_error and angle_error allow: the
  /// sensor's pose in tf is wrong, and no correction is applied.
  bool has_drifted = false;
  std::vector<LinkView> links;  ///< those with points in their skin
};

}  // namespace ist
